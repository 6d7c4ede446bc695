"""A batch of robots: each has its own model, and an error names its robot."""

import mujoco
import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.simulator import SimulationDivergedError
from mecanum_env.simulator.robot import at_rest
from mecanum_env.tankendo.plant import RobotBatch, compile_model


@pytest.mark.parametrize("row", [0, 1, 2])
def test_the_robot_that_diverged_is_named(paper, row):
    robots = RobotBatch(compile_model(paper, "planar"), 3)
    commands = np.zeros((3, 3))
    commands[row] = np.nan
    with pytest.raises(SimulationDivergedError, match=f"robot {row} diverged"):
        robots.step(commands)


def test_a_robot_that_diverged_begins_anew(paper):
    robots = RobotBatch(compile_model(paper, "planar"), 2)
    commands = np.array([[40.0, 0.0, 0.0], [np.nan, 0.0, 0.0]])
    with pytest.raises(SimulationDivergedError, match="robot 1 diverged"):
        robots.step(commands)
    for row in (0, 1):
        robots.restart(row, (0, 0, 0))
    robots.step(commands[[0, 0]])
    first, second = robots.motion().T
    np.testing.assert_array_equal(first, second)


def test_robots_that_do_not_go_together_are_refused_and_the_others_kept(paper):
    """A payload is one more body."""
    common, loaded = (
        compile_model(one, "planar") for one in (paper, paper.with_effect("payload", mass_kg=3))
    )
    robots = RobotBatch(common, 2)
    with pytest.raises(InputError, match="other bodies or joints than the common one"):
        robots.restart(1, (0, 0, 0), loaded)
    assert robots.model_of(1) is paper
    robots.restart(1, (0, 0, 0))
    robots.step(np.zeros((2, 3)))


def test_the_planar_plant_is_at_rest_where_all_its_numbers_are_0(paper):
    mj_model = compile_model(paper.with_effect("backlash", gap_deg=3.0), "planar").mj_model
    data, state = at_rest(mj_model), mujoco.mjtState.mjSTATE_INTEGRATION
    rest = np.ones(mujoco.mj_stateSize(mj_model, state))
    mujoco.mj_getState(mj_model, data, rest, state)
    assert not rest.any()
