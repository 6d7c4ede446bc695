"""Build the wheel, install it into a bare virtual environment and run tests there, away from the checkout.

Only the tests of what an installation can break run by default: the compiled plugin, packaged files,
programs, optional dependencies, public names and the environments. Arguments are passed to pytest in their
stead.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
EXTRAS = "report,bag,parquet,zoo"
QUICK = (
    "tests/plugin",
    "tests/rendering",
    "tests/mjcf/test_write.py",
    "tests/test_architecture.py",
    "tests/test_cli.py",
    "tests/test_files.py",
    "tests/test_model.py",
    "tests/fit/test_command_line.py",
    "tests/fit/test_fit_report.py",
    "tests/gap/report",
    "tests/logs",
    "tests/tankendo/test_env.py",
    "tests/tankendo/test_vector.py",
    "tests/training/record",
)
"""Tests of what differs between a checkout and an installation."""


def main() -> int:
    """Return pytest's exit code."""
    with tempfile.TemporaryDirectory(prefix="mecanum-wheel-") as folder:
        work = Path(folder)
        _run(sys.executable, "-m", "build", "--wheel", "--outdir", work / "dist", ROOT)
        wheel = next((work / "dist").glob("*.whl"))
        venv.create(work / "venv", with_pip=True)
        python = work / "venv" / "bin" / "python"
        install = (python, "-m", "pip", "install", "--quiet", "-c", ROOT / "constraints.txt")
        _run(*install, f"{wheel}[{EXTRAS}]", "pytest", "pytest-xdist", "hypothesis")
        # Only what is no part of the package: a test that finds the checkout's code would prove nothing.
        for name in ("tests", "examples", "benchmarks", "docs"):
            shutil.copytree(ROOT / name, work / "elsewhere" / name)
        shutil.copy(ROOT / "pyproject.toml", work / "elsewhere")
        environment = {**os.environ, "MECANUM_REAL_LOGS": _real_logs()}
        command = [
            str(python),
            "-m",
            "pytest",
            "-n",
            "auto",
            "-m",
            "not slow",
            "-q",
            *(sys.argv[1:] or QUICK),
        ]
        return subprocess.run(command, cwd=work / "elsewhere", env=environment, check=False).returncode


def _real_logs() -> str:
    return os.environ.get("MECANUM_REAL_LOGS", str(ROOT.parent / "shared" / "data"))


def _run(*command: object) -> None:
    subprocess.run([str(part) for part in command], check=True)


if __name__ == "__main__":
    sys.exit(main())
