"""Build the wheel, install it into bare virtual environments and run tests there, away from the checkout.

One wheel serves all Pythons of the platform and the MuJoCo releases under [tool.mecanum] in pyproject.toml.
MECANUM_PYTHONS names the interpreters to test, separated by spaces (default: this one). MECANUM_MUJOCOS names
releases of MuJoCo that take the place of the pinned one, each for the tests of what depends on it.

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
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
EXTRAS = "bag,parquet,mcap,zoo"
TOOLS = ("pytest", "pytest-xdist", "hypothesis")
OF_MUJOCO = ("tests/plugin", "tests/rendering", "tests/mjcf/test_write.py")
"""Tests of what differs between releases of MuJoCo."""
QUICK = (
    *OF_MUJOCO,
    "tests/cli",
    "tests/test_architecture.py",
    "tests/test_cli.py",
    "tests/test_files.py",
    "tests/test_model.py",
    "tests/fit/test_command_line.py",
    "tests/fit/report/test_fit_report.py",
    "tests/gap/report",
    "tests/logs",
    "tests/tankendo/test_env.py",
    "tests/tankendo/test_vector.py",
    "tests/training/record",
)
"""Tests of what differs between a checkout and an installation."""


def main() -> int:
    """Return the largest of pytest's exit codes."""
    pythons = os.environ.get("MECANUM_PYTHONS", sys.executable).split()
    releases = os.environ.get("MECANUM_MUJOCOS", "").split()
    with tempfile.TemporaryDirectory(prefix="mecanum-wheel-") as folder:
        work = Path(folder)
        _run(sys.executable, ROOT / ".ci" / "mujoco_releases.py", work / "mujoco")
        os.environ["MECANUM_MUJOCO"] = str(work / "mujoco")
        _run(sys.executable, "-m", "build", "--wheel", "--outdir", work / "dist", ROOT)
        wheel = next((work / "dist").glob("*-py3-none-*.whl"))
        # Only what is no part of the package: a test that finds the checkout's code would prove nothing.
        for name in ("tests", "examples", "benchmarks", "docs"):
            shutil.copytree(ROOT / name, work / "elsewhere" / name)
        shutil.copy(ROOT / "pyproject.toml", work / "elsewhere")
        return max(_test(work, wheel, python, releases) for python in pythons)


def _test(work: Path, wheel: Path, interpreter: str, releases: list[str]) -> int:
    """Install the wheel for an interpreter and return the largest of pytest's exit codes."""
    _run(interpreter, "-m", "venv", "--clear", work / "venv")
    python = work / "venv" / "bin" / "python"
    install = (python, "-m", "pip", "install", "--quiet")
    _run(*install, "-c", ROOT / "constraints.txt", f"{wheel}[{EXTRAS}]", *TOOLS)
    codes = [_pytest(python, work, sys.argv[1:] or QUICK)]
    for release in releases:
        # mujoco 4.0.1 exists as mujoco-core alone; both put the same module into place.
        name = "mujoco" if release.startswith("3") else "mujoco-core"
        _run(python, "-m", "pip", "uninstall", "--quiet", "--yes", "mujoco", "mujoco-core", "mujoco-studio")
        _run(*install, "--no-deps", f"{name}=={release}")
        codes.append(_pytest(python, work, OF_MUJOCO))
    return max(codes)


def _pytest(python: Path, work: Path, tests: Sequence[str]) -> int:
    environment = {**os.environ, "MECANUM_REAL_LOGS": _real_logs()}
    command = [
        str(python),
        "-m",
        "pytest",
        "-n",
        os.environ.get("MECANUM_JOBS", "auto"),
        "-m",
        "not slow",
        "-q",
    ]
    return subprocess.run([*command, *tests], cwd=work / "elsewhere", env=environment, check=False).returncode


def _real_logs() -> str:
    return os.environ.get("MECANUM_REAL_LOGS", str(ROOT.parent / "shared" / "data"))


def _run(*command: object) -> None:
    subprocess.run([str(part) for part in command], check=True)


if __name__ == "__main__":
    sys.exit(main())
