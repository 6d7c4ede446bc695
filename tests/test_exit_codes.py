"""Exit codes: 2 for bad input, 3 for a failed machine or program: one sentence, the traceback in a file."""

import errno
import os
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mecanum_env.cli import run
from mecanum_env.errors import MachineError
from mecanum_env.files import write_text
from mecanum_env.outputs import output_folder
from mecanum_env.parallel.tasks import WorkerLostError

ROOT = Path(__file__).parents[1]


def failing(error):
    def work(out: Path = Path("result")) -> None:
        """Fail.

        Args:
            out: where.
        """
        del out
        raise error

    return work


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), 3, "the machine failed: No space left on device;"),
        (MemoryError(), 3, "the machine failed: out of memory;"),
        (WorkerLostError("the task a lost its worker"), 3, "the task a lost its worker"),
        (MachineError("disk"), 3, "disk"),
        (
            ZeroDivisionError("division by zero"),
            3,
            "ZeroDivisionError: division by zero; a fault of the program",
        ),
        (RuntimeError("two\nlines"), 3, "RuntimeError: two lines; a fault"),
        (FileNotFoundError(errno.ENOENT, "No such file", "a.csv"), 2, "a.csv: cannot be used (No such file)"),
    ],
)
def test_an_error_has_its_exit_code_and_one_sentence(error, code, said, tmp_path, capsys):
    assert run(failing(error), ["--out", str(tmp_path / "fit")]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"error: {said}")
    assert err.count("\n") == 1
    kept = tmp_path / "fit.error.txt"
    assert kept.exists() == (code == 3)
    if code == 3:
        assert str(kept) in err
        assert "Traceback" in kept.read_text()
        assert f"{type(error).__name__}" in kept.read_text()


def test_a_traceback_is_kept_elsewhere_if_the_output_cannot_be_written(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path))
    assert run(failing(ZeroDivisionError()), ["--out", str(tmp_path / "no" / "such" / "fit")]) == 3
    assert (tmp_path / "fit.error.txt").exists()
    assert str(tmp_path / "fit.error.txt") in capsys.readouterr().err


def test_a_sentence_is_never_a_book(capsys):
    assert run(failing(MachineError("x" * 100_000)), []) == 3
    Path("result.error.txt").unlink()
    assert len(capsys.readouterr().err) < 3000


def test_a_full_output_stream_is_a_failed_machine():
    program = "import sys; from mecanum_env.cli import run\ndef say() -> None:\n    'Say.'\n    print(1)\n"
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-c", f"{program}sys.exit(run(say, []))"],
            stdout=full, stderr=subprocess.PIPE, text=True, cwd=ROOT, check=False,
        )  # fmt: skip
    Path(ROOT / "say.error.txt").unlink(missing_ok=True)
    assert "No space left on device" in done.stderr
    assert done.returncode == 3


def write(out: Path, size: int = 1) -> None:
    """Write a result.

    Args:
        out: folder.
        size: of the file.
    """
    with output_folder(out, "test", ("a.txt", "b.txt")) as staged:
        write_text(staged / "a.txt", "new")
        write_text(staged / "b.txt", "x" * size)


def test_a_file_beyond_the_limit_is_a_failed_machine(tmp_path, capsys):
    """Stands for a full disk where no file system can be mounted."""
    out = tmp_path / "out"
    assert run(write, ["--out", str(out)]) == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))
    try:
        assert run(write, ["--out", str(out), "--size", "1000000"]) == 3
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert "b.txt: not written (File too large)" in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


@pytest.fixture
def small_disk(tmp_path):
    """Yield a file system of 256 kB."""
    place = tmp_path / "disk"
    place.mkdir()
    if os.geteuid() != 0 or shutil.which("mount") is None:
        pytest.skip("only root can mount a small file system")
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", str(place)], capture_output=True, check=False
    )
    if done.returncode:
        pytest.skip(f"no file system can be mounted here: {done.stderr.decode().strip()}")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def test_a_full_disk_leaves_the_old_results(small_disk, capsys):
    out = small_disk / "out"
    assert run(write, ["--out", str(out)]) == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    assert run(write, ["--out", str(out), "--size", "1000000"]) == 3
    assert "No space left on device" in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def test_a_read_only_disk_is_refused_before_the_work(small_disk, capsys):
    subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True)
    assert run(write, ["--out", str(small_disk / "out")]) == 2
    assert "cannot be written (Read-only file system); choose another folder" in capsys.readouterr().err


def test_a_disk_that_turns_read_only_is_a_failed_machine(small_disk, capsys):
    def work(out: Path) -> None:
        """Write."""
        with output_folder(out, "test") as staged:
            write_text(staged / "a.txt", "new")
            subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True)

    assert run(work, ["--out", str(small_disk / "out")]) == 3
    assert "Read-only file system" in capsys.readouterr().err
