"""Command line programs: exit codes, and one sentence on stderr."""

import importlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from mecanum_env.cli import run
from mecanum_env.errors import BackendError, InputError, MecanumError, UnstableLawError, did_you_mean
from mecanum_env.files import asset_path


def greet(name: str, times: int = 1) -> None:
    """Print a greeting.

    Args:
        name: whom to greet.
        times: how often.
    """
    print(f"hello {name} " * times)


def refuse() -> None:
    """Refuse."""
    raise InputError("a.csv, line 3: speed_rpm = 'x', must be a number")


def stop() -> None:
    """Be interrupted."""
    raise KeyboardInterrupt


def test_a_command_that_returns_exits_with_0(capsys):
    assert run(greet, ["--name", "world", "--times", "2"]) == 0
    assert capsys.readouterr().out == "hello world hello world \n"


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("arguments", [["--help"], ["--name", "world"]])
def test_output_whose_reader_has_gone_is_no_fault(arguments, unbuffered):
    script = f"from tests.test_cli import greet, run; raise SystemExit(run(greet, {arguments}))"
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [sys.executable, "-c", script],
        stdout=writing,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
        check=False,
    )
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")


def test_the_help_of_an_argument_is_broken_where_the_terminal_ends(capsys, monkeypatch):
    def tell(name: str = "") -> None:
        """Tell.

        Args:
            name: whom to tell, in words that take more room than a line of the docstring has, which ends
                here.
        """

    monkeypatch.setenv("COLUMNS", "200")
    with pytest.raises(SystemExit):
        run(tell, ["--help"])
    assert "in words that take more room than a line of the docstring has, which ends here." in (
        capsys.readouterr().out
    )


def test_a_verdict_is_the_exit_code():
    def judge() -> int:
        """Fail."""
        return 1

    assert run(judge, []) == 1


def test_bad_input_is_one_sentence_on_stderr_and_exit_code_2(capsys):
    assert run(refuse, []) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err == "error: a.csv, line 3: speed_rpm = 'x', must be a number\n"


def test_an_interrupt_exits_with_130(capsys):
    assert run(stop, []) == 130
    assert "interrupted" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["--name", ""], "--name is empty"),
        (["--name=", "--times", "2"], "--name is empty"),
        ([""], "an argument is empty"),
    ],
)
def test_an_empty_argument_is_refused(args, said, capsys):
    assert run(greet, args) == 2
    assert capsys.readouterr() == ("", f"error: {said}; give a value, or leave it out\n")


@pytest.mark.parametrize("args", [["--name", "a", "--tmes", "2"], [], ["--name", "a", "--times", "x"]])
def test_wrong_arguments_exit_with_2(args, capsys):
    with pytest.raises(SystemExit) as exit_info:
        run(greet, args)
    assert exit_info.value.code == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err != ""


def test_help_is_the_docstring(capsys):
    with pytest.raises(SystemExit) as exit_info:
        run(greet, ["--help"])
    assert exit_info.value.code == 0
    assert "whom to greet" in capsys.readouterr().out


@pytest.mark.parametrize("error", [InputError, UnstableLawError, BackendError])
def test_every_error_is_of_the_family(error):
    assert issubclass(error, MecanumError)


def test_did_you_mean_names_only_what_is_near():
    assert did_you_mean("friktion", ["friction", "mass_kg"]) == ' (did you mean "friction"?)'
    assert did_you_mean("colour", ["friction", "mass_kg"]) == ""


@pytest.mark.parametrize(
    ("program", "arguments", "message"),
    [
        ("sysid.studies.reproduce", ["--seed", "-1"], "seed = -1, must be at least 0"),
        ("sysid.studies.zoo", ["--first-seed", "-1"], "first-seed = -1, must be at least 0"),
        ("training.certify", ["still", "--jobs", "-1"], "jobs = -1, must be at least 0 (0: all processors)"),
        ("sysid.studies.zoo", ["--ray-address", "a:1"], "ray-address = a:1: needs --backend ray"),
    ],
)
def test_a_number_that_is_too_small_is_refused_before_the_work(
    program, arguments, message, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert run(importlib.import_module(f"{program}.__main__").main, arguments) == 2
    assert capsys.readouterr().err == f"error: {message}\n"
    assert list(tmp_path.iterdir()) == []


LOGS = str(Path(__file__).parents[1] / "examples" / "logs")


@pytest.mark.parametrize(
    ("program", "main", "work", "arguments"),
    [
        ("sysid.fit", "fit", "sysid.fit.pipeline.fit_dataset", [LOGS]),
        (
            "sysid.gap",
            "gap",
            "sysid.gap.workflow.analyse",
            [LOGS, "--model", str(asset_path("models/paper.json"))],
        ),
        ("sysid.studies.zoo", "main", "sysid.studies.zoo.work.run_tasks", ["--quick"]),
        ("sysid.studies.paper_gap", "main", "sysid.studies.paper_gap.study.paper_gap", []),
        ("sysid.studies.reproduce", "main", "sysid.studies.reproduce.experiment.reproduce", ["--quick"]),
        ("sysid.online", "main", "sysid.online.replay.replay", [LOGS]),
        ("training.certify", "main", "training.certify.run.certify_controller", ["still"]),
        ("training.compare", "main", "training.compare.comparison.compare_controllers", ["still"]),
    ],
)
def test_results_that_could_not_be_written_are_refused_before_the_work(
    program, main, work, arguments, tmp_path, capsys, monkeypatch
):
    module = importlib.import_module(f"{program}.__main__")
    monkeypatch.setattr(work, lambda *_, **__: pytest.fail("worked before it looked"))
    (tmp_path / "file").touch()
    out = tmp_path / "file" / "result.json"
    assert run(getattr(module, main), [*arguments, "--out", str(out)]) == 2
    assert "file/result.json" in (said := capsys.readouterr().err)
    assert "cannot be written (Not a directory); choose another folder" in said
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
