import mujoco
import numpy as np
import pytest

from mecanum_env.model import paper_model
from mecanum_env.simulator import SimulationDivergedError, compile_plant, step_through
from mecanum_env.simulator.robot import at_rest


@pytest.fixture(scope="module")
def robot():
    return compile_plant(paper_model())


def test_chunks_change_nothing(robot):
    ctrl = np.random.default_rng(0).uniform(-80, 80, (60, 4))
    whole, parts = at_rest(robot), at_rest(robot)
    one = step_through(robot, whole, ctrl)
    two = step_through(robot, parts, ctrl, chunk_steps=7)
    np.testing.assert_array_equal(one[0], two[0])
    np.testing.assert_array_equal(one[1], two[1])
    np.testing.assert_array_equal(whole.plugin_state, parts.plugin_state)


def test_it_steps_as_mj_step_does_and_goes_on(robot):
    ctrl = np.random.default_rng(1).uniform(-80, 80, (40, 4))
    ours, theirs = at_rest(robot), at_rest(robot)
    qpos, qvel = step_through(robot, ours, ctrl[:20])
    for row in ctrl[:20]:
        theirs.ctrl[:] = row
        mujoco.mj_step(robot, theirs)
    np.testing.assert_array_equal(qpos[-1], theirs.qpos)
    np.testing.assert_array_equal(qvel[-1], theirs.qvel)
    qpos, _ = step_through(robot, ours, ctrl[20:])
    for row in ctrl[20:]:
        theirs.ctrl[:] = row
        mujoco.mj_step(robot, theirs)
    np.testing.assert_array_equal(qpos[-1], theirs.qpos)


def test_data_that_were_driven_are_as_new_once_at_rest(robot):
    ctrl = np.random.default_rng(2).uniform(-80, 80, (30, 4))
    fresh, used = at_rest(robot), at_rest(robot)
    step_through(robot, used, -ctrl)
    assert at_rest(robot, data=used) is used
    for one, other in zip(step_through(robot, fresh, ctrl), step_through(robot, used, ctrl), strict=True):
        np.testing.assert_array_equal(one, other)


def test_at_rest_is_the_origin_at_time_zero(robot):
    data = at_rest(robot)
    assert data.time == 0
    assert np.all(data.qvel == 0)
    assert np.all(data.plugin_state == 0)
    assert np.max(np.abs(data.qpos[:2])) < 1e-4
    # The floor carries the robot: what pushes it up is its weight.
    weight = float(np.sum(robot.body_mass)) * 9.81
    assert data.qfrc_constraint[2] == pytest.approx(weight, rel=0.02)


def test_a_diverged_state_says_when(robot):
    data = at_rest(robot)
    data.qvel[0] = 1e12
    with pytest.raises(SimulationDivergedError, match=r"diverged after 0\.\d+ s \(.*(QVEL|QPOS|QACC)"):
        step_through(robot, data, np.zeros((5, 4)))


def test_no_controls_give_the_start_alone(robot):
    data = at_rest(robot)
    qpos, qvel = step_through(robot, data, np.zeros((0, 4)))
    np.testing.assert_array_equal(qpos, data.qpos[None])
    np.testing.assert_array_equal(qvel, data.qvel[None])
