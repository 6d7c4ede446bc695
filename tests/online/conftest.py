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
