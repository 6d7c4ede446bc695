from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from sysid.logs import BenchCommand, Run, Split

STEP = "time_s,command_rpm,speed_rpm\n0,0,0\n0.1,40,0\n0.2,40,30\n0.3,40,39\n"


@pytest.fixture
def folder(tmp_path: Path) -> Callable[..., Path]:
    """Write files (keyword or dict name -> text or bytes) into a folder and return it."""

    def write(files: dict[str, str | bytes]) -> Path:
        path = tmp_path / "logs"
        path.mkdir(exist_ok=True)
        for name, content in files.items():
            (path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


@pytest.fixture
def step() -> str:
    return STEP


@pytest.fixture(scope="session")
def bench_run() -> Callable[..., Run]:
    """Make a bench run in memory, at 100 Hz; the wheel follows exactly where no speed is given."""

    def make(
        file: str,
        command_rpm: npt.ArrayLike,
        speed_rpm: npt.ArrayLike | None = None,
        *,
        time_s: npt.ArrayLike | None = None,
        group: str = "",
        split: Split = "fit",
    ) -> Run:
        command = np.asarray(command_rpm, float)
        speed = command if speed_rpm is None else np.asarray(speed_rpm, float)
        time = 0.01 * np.arange(command.size) if time_s is None else np.asarray(time_s, float)
        return Run(file, group, split, time, BenchCommand(command), {"speed_rpm": speed})

    return make


@pytest.fixture(scope="session")
def step_command() -> Callable[..., npt.NDArray[np.float64]]:
    """Make a step at 100 Hz: rest, then one speed."""

    def make(speed_rpm: float, before: int = 20, after: int = 100) -> npt.NDArray[np.float64]:
        return np.concatenate([np.zeros(before), np.full(after, float(speed_rpm))])

    return make
