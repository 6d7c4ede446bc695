"""Command line programs: exit codes, and one sentence on stderr."""

import pytest

from mecanum_env.cli import run
from mecanum_env.errors import BackendError, InputError, MecanumError, UnstableLawError, did_you_mean


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


def test_a_programming_error_is_not_hidden():
    def broken() -> None:
        """Break."""
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run(broken, [])


@pytest.mark.parametrize("error", [InputError, UnstableLawError, BackendError])
def test_every_error_is_of_the_family(error):
    assert issubclass(error, MecanumError)


def test_did_you_mean_names_only_what_is_near():
    assert did_you_mean("friktion", ["friction", "mass_kg"]) == ' (did you mean "friction"?)'
    assert did_you_mean("colour", ["friction", "mass_kg"]) == ""
