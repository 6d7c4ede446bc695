"""A simple drive is found from its cost alone, wherever in the ranges of its numbers it is."""

import math

import numpy as np
import pytest

from mecanum_env.law.stability import POLE_LIMIT
from mecanum_env.model import Model, paper_model
from mecanum_env.simulator import replay_bench
from sysid.compare.search_space import effect_set
from sysid.fit.effects.simple_drive import SIMPLE_DRIVE, simple_drive

TIME_S = np.arange(240) / 120.0
COMMAND_RPM = np.repeat([0.0, 90.0, -40.0, 20.0, 110.0, -110.0, 0.0, 60.0], 30)


def speeds(model: Model) -> np.ndarray:
    """Return the speeds [rpm] of a wheel on the bench, shape (240,)."""
    return replay_bench(model, TIME_S, COMMAND_RPM)


@pytest.mark.parametrize(("delay_s", "limit_rpm_s"), [(0.12, 350.0), (0.03, 900.0)])
def test_a_delay_before_a_ramp_is_found_without_a_place_to_start(delay_s, limit_rpm_s):
    alone = paper_model()
    true = alone.with_effect("command_latency", delay_s=delay_s)
    measured = speeds(true.with_effect("acceleration_limit", limit_rpm_s=limit_rpm_s))

    def cost(model: Model) -> float:
        return float(np.mean((speeds(model) - measured) ** 2))

    found = simple_drive(alone, effect_set(alone, SIMPLE_DRIVE), POLE_LIMIT, cost)
    assert math.sqrt(cost(found)) < 0.1 * math.sqrt(cost(alone))
    assert found.effects["acceleration_limit"]["limit_rpm_s"] == pytest.approx(limit_rpm_s, rel=0.1)
    # The packaged law's own rise is a lag and a delay to the simple drive, whose lag is of first order.
    assert found.effects["command_latency"]["delay_s"] == pytest.approx(delay_s, abs=0.04)


def test_the_simple_drive_has_a_stable_law_of_first_order_and_no_other_effects():
    def cost(model: Model) -> float:
        return abs(model.wheel.law.A - 0.5)

    alone = paper_model().with_effect("backlash", gap_deg=5.0)
    found = simple_drive(alone, effect_set(alone, SIMPLE_DRIVE), POLE_LIMIT, cost)
    assert found.wheel.law.coefficients == pytest.approx((0.5, 0.0, 0.0, 0.5, 0.0, 0.0), abs=0.01)
    assert "backlash" not in found.effects
