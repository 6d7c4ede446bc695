from collections.abc import Callable
from pathlib import Path

import pytest

from sysid.logs.__main__ import main

Folder = Callable[[dict[str, str | bytes]], Path]


def test_check_prints_runs_splits_and_findings(
    folder: Folder, step: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = folder({"a.csv": step, "b.csv": step, "c.csv": step.replace("40", "140")})
    assert main(["check", str(path)]) == 0
    out = capsys.readouterr().out
    assert "logs: bench log, 3 runs (2 fit, 1 test), 2 command sequences" in out
    assert "b.csv  a      test      4     0.30  10         2" in out
    assert "- beyond_limit: speeds above the 135 rpm of the paper's robot [1 of 3 runs]" in out
    assert "noise floor of speed_rpm: 0 rpm" in out


def test_all_findings_are_printed_on_request(
    folder: Folder, step: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = folder({f"{v}.csv": step.replace("40", str(v)) for v in (140, 150, 160)})
    main(["check", str(path)])
    assert "and 2 more (--all-findings)" in capsys.readouterr().out
    main(["check", str(path), "--all-findings"])
    out = capsys.readouterr().out
    assert out.count("command up to") == 3
    assert "noise floor: unknown" in out


def test_bad_logs_are_one_sentence_and_exit_code_2(
    folder: Folder, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", str(folder({"a.csv": "time_s;speed_rpm\n"}))]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("error: ")
    assert captured.err.count("\n") == 1


@pytest.mark.parametrize(("arguments", "code"), [([], 2), (["chek"], 2), (["--help"], 0)])
def test_usage_lists_the_commands(
    arguments: list[str], code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == code
    captured = capsys.readouterr()
    assert "check" in captured.out + captured.err
    assert "import" in captured.out + captured.err
