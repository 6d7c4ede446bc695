"""`python -m sysid.gap`: what it writes and prints; bad input is refused with nothing written."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.model import paper_model, read_model, write_model
from mecanum_env.simulator import read_commands
from sysid.gap import __main__ as program
from sysid.gap.report import output
from sysid.gap.report.output import write_study
from sysid.gap.result import GapOptions, GapReport

EXAMPLES = Path(__file__).parents[3] / "examples" / "logs"


@pytest.fixture
def model_file(tmp_path: Path) -> Path:
    write_model(paper_model(), tmp_path / "paper.json")
    return tmp_path / "paper.json"


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch, ambiguous: GapReport) -> list[GapOptions]:
    """Replace the study by a fixed report, and collect the options it is called with."""
    options: list[GapOptions] = []

    def instead(*given: Any) -> GapReport:
        _, _, asked, progress = given
        progress("search")
        options.append(asked)
        return ambiguous

    monkeypatch.setattr("sysid.gap.workflow.analyse", instead)
    return options


def study(model: Path, out: Path, *more: str) -> int:
    return run(program.gap, [str(EXAMPLES), "--model", str(model), "--out", str(out), *more])


def test_every_file_is_written_and_ten_lines_are_printed(
    asked: list[GapOptions], model_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    out = tmp_path / "out"
    assert study(model_file, out, "--seed", "3", "--only", "backlash", "stiction", "--adopt") == 0
    assert {path.name for path in out.iterdir()} == {
        "gap.json", "model.json", "report.html", "next_experiment.csv", "mecanum-output.json",
    }  # fmt: skip
    assert asked[0] == GapOptions(seed=3, only=("backlash", "stiction"), adopt=True)
    said = capsys.readouterr()
    assert said.out.startswith("robot, eight drives: The model lacks roller_friction")
    assert "wrote " in said.out
    assert "\r" not in said.err  # no bar where nobody watches
    assert json.loads((out / "gap.json").read_text())["verdict"] == "ambiguous"
    assert set(read_model(out / "model.json").effects) == {"roller_friction"}


def test_the_next_experiment_can_be_driven(ambiguous: GapReport, tmp_path: Path):
    write_study(ambiguous, tmp_path)
    commands = read_commands(tmp_path / "next_experiment.csv")
    assert commands.time_s[-1] == ambiguous.next_experiment.duration_s
    planned = ambiguous.next_experiment.columns["command_v_rpm"]
    assert np.array_equal(commands.v_rpm[:-1], planned)


def test_what_an_earlier_study_left_is_not_mistaken_for_this_one_s(
    ambiguous: GapReport, no_gap: GapReport, tmp_path: Path
):
    write_study(ambiguous, tmp_path)
    written = write_study(no_gap, tmp_path)
    assert sorted(tmp_path.iterdir()) == sorted(written)
    assert not (tmp_path / "next_experiment.csv").exists()


def test_all_files_are_written_or_none(
    ambiguous: GapReport, no_gap: GapReport, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    write_study(no_gap, tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def fails(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(output, "write_columns", fails)  # the last of the files
    with pytest.raises(KeyboardInterrupt):
        write_study(ambiguous, tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--only", "backlush"], 'no such effect (did you mean "backlash"?)'),
        (["--exclude", "baklash"], 'no such effect (did you mean "backlash"?)'),
        (["--only", "payload"], "only payload: has no effect in bench logs"),
        (["--only", "backlash", "--exclude", "backlash"], "excluded as well"),
        (["--level", "robot"], "these are bench logs"),
        (["--max-effects", "0"], "max-effects = 0, must be at least 1"),
        (["--jobs", "0"], "jobs = 0, must be at least 1"),
        (["--seed", "-1"], "seed = -1"),
    ],
)
def test_bad_options_are_one_sentence_and_exit_code_two(
    asked: list[GapOptions], model_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    extra: list[str], message: str,
):  # fmt: skip
    assert study(model_file, tmp_path / "out", *extra) == 2
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    assert len(errors) == 1
    assert message in errors[0]
    assert asked == []
    assert not (tmp_path / "out").exists()


def test_a_missing_model_and_bad_logs_are_refused(
    model_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    assert study(tmp_path / "none.json", tmp_path / "out") == 2
    assert "none.json: cannot be read" in capsys.readouterr().err
    (tmp_path / "a.csv").write_text("time_s,command_rpm,speed_rpm\n0,0,0\n0.1,40,fast\n")
    assert run(program.gap, [str(tmp_path / "a.csv"), "--model", str(model_file)]) == 2
    assert "fast" in capsys.readouterr().err


def test_a_folder_that_cannot_be_made_is_refused(no_gap: GapReport, tmp_path: Path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_study(replace(no_gap), tmp_path / "file" / "out")


def test_a_study_does_not_replace_the_model_that_it_reads(
    asked: list[GapOptions], tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    write_model(paper_model(), tmp_path / "model.json")
    before = (tmp_path / "model.json").read_bytes()
    assert study(tmp_path / "model.json", tmp_path) == 2
    assert "its own input; choose another folder" in capsys.readouterr().err
    assert (tmp_path / "model.json").read_bytes() == before
    assert asked == []
