import os
from pathlib import Path

import pytest

from mecanum_env.law import WheelLaw
from mecanum_env.model import paper_model
from sysid.online import first_order_law


@pytest.fixture
def law() -> WheelLaw:
    return paper_model().wheel.law


@pytest.fixture
def start(law) -> WheelLaw:
    return first_order_law(law.sample_period_s)


@pytest.fixture
def real_logs() -> Path:
    """Return the folder of recordings of real robots; skip where there is none."""
    path = Path(os.environ.get("MECANUM_REAL_LOGS", Path(__file__).parents[3] / "shared" / "data"))
    if not path.is_dir():
        pytest.skip("no real logs here; set MECANUM_REAL_LOGS to the folder with husky/ and micromouse/")
    return path
