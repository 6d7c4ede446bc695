"""How a robot's run starts that begins in motion, and what of it is compared."""

from __future__ import annotations

import numpy as np
import pytest

from mecanum_env.kinematics import WHEEL_SPEEDS
from sysid.compare.measured import observe, start_of
from sysid.compare.measured.observations import UNKNOWN_S, WINDOW_S
from sysid.logs import BodyCommand, Dataset, Run

TIME = 0.02 * np.arange(100)
SPEEDS = (30.2, 40.0, 29.8, 41.0)


def driving(wheels_rpm: tuple[float, ...], v_rpm: float = 60.0) -> Run:
    """Return a run with steady wheels, without noise, that drives at 0.5 m/s from x = 1 m."""
    ones = np.ones(TIME.size)
    channels = {name: speed * ones for name, speed in zip(WHEEL_SPEEDS, wheels_rpm, strict=True)}
    channels |= {"x_m": 1.0 + 0.5 * TIME, "y_m": 0.0 * ones, "yaw_rad": 0.0 * ones}
    return Run("x.csv", "x", "fit", TIME, BodyCommand(v_rpm * ones, 0.0 * ones, 0.0 * ones), channels)


def test_a_robot_in_motion_starts_at_its_measured_speeds_and_where_it_was_in_the_first_row() -> None:
    start = start_of(driving(SPEEDS))
    assert (start.moving, start.wheels_rpm) == (True, (30.0, 40.0, 30.0, 41.0))
    assert start.x_m == pytest.approx(1.0)


@pytest.mark.parametrize(
    "run", [driving((0.0,) * 4), driving(SPEEDS, v_rpm=0.0)], ids=["at rest", "no command"]
)
def test_a_robot_at_rest_or_without_a_command_is_not_in_motion(run: Run) -> None:
    start = start_of(run)
    assert (start.moving, start.wheels_rpm) == (False, ())


@pytest.mark.parametrize(
    ("speeds", "speed_from", "pose_from"), [(SPEEDS, UNKNOWN_S, WINDOW_S), ((0.0,) * 4, 0.0, 0.0)]
)
def test_the_first_moments_are_compared_only_of_a_robot_that_starts_at_rest(
    speeds: tuple[float, ...], speed_from: float, pose_from: float
) -> None:
    blocks = {block.channel: block for block in observe(Dataset("x", (driving(speeds),), ())).blocks}
    assert blocks["speed_fl_rpm"].time_s[0] == pytest.approx(speed_from)
    assert blocks["x_m"].time_s[0] == pytest.approx(pose_from + 0.5 * WINDOW_S)
