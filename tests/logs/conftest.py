import os
from collections.abc import Callable
from pathlib import Path

import pytest

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
def real_logs() -> Path:
    """The folder of recordings of real robots, which is not part of the repository."""
    default = Path(__file__).parents[2].parent / "shared" / "data"
    path = Path(os.environ.get("MECANUM_REAL_LOGS", default))
    if not (path / "husky").is_dir():
        pytest.skip(
            "no real logs here; set MECANUM_REAL_LOGS to the folder that holds husky/ and micromouse/"
        )
    return path
