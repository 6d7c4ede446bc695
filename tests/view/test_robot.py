"""The robot that is driven, and the effects that are offered."""

import numpy as np
import pytest

from mecanum_env.effects import CATALOGUE
from mecanum_env.errors import EffectRefusedError, InputError
from mecanum_env.simulator import RobotSession
from mecanum_env.view.choices import choices_for, first_on, with_effects
from mecanum_env.view.robot import LiveRobot

AHEAD = (80.0, 0.0, 0.0)


@pytest.fixture(params=["rollers", "planar"])
def plant(request):
    return request.param


def test_it_drives_as_a_session_does(paper, plant):
    robot, session = LiveRobot(paper, plant), RobotSession(paper, plant)
    for _ in range(5):
        motion = robot.advance(AHEAD, 0.1)
        session.advance(*AHEAD)
    np.testing.assert_array_equal(motion.pose[:2], session.pose[:2])


def test_slices_of_any_length_make_the_same_motion(paper, plant):
    one, many = LiveRobot(paper, plant), LiveRobot(paper, plant)
    whole = one.advance(AHEAD, 0.5)
    step = many.mj_model.opt.timestep
    for steps in (7, 31, round(0.5 / step) - 38):
        parts = many.advance(AHEAD, steps * step)
    np.testing.assert_array_equal(parts.pose, whole.pose)


def test_a_change_that_changes_nothing_is_not_felt(paper, plant):
    changed, plain = LiveRobot(paper, plant), LiveRobot(paper, plant)
    for robot in (changed, plain):
        robot.advance(AHEAD, 0.25)
    changed.change(paper)
    np.testing.assert_allclose(
        changed.advance(AHEAD, 0.3).pose, plain.advance(AHEAD, 0.3).pose, rtol=0.0, atol=1e-6
    )


def test_an_effect_acts_from_where_the_robot_is(paper):
    robot = LiveRobot(paper)
    before = robot.advance(AHEAD, 1.0)
    robot.change(paper.with_effect("speed_gain", gain=0.5))
    after = robot.advance(AHEAD, 1.0)
    assert robot.time_s == pytest.approx(2.0)
    assert after.pose[0] > before.pose[0] + 0.2
    np.testing.assert_allclose(after.wheels_rpm[-1], 40.0, atol=1.0)


def test_a_limit_on_the_whole_command_can_be_switched_on(paper):
    robot = LiveRobot(paper)
    robot.change(paper.with_effect("body_speed_limit", v_rpm=30.0))
    np.testing.assert_allclose(robot.advance(AHEAD, 1.0).wheels_rpm[-1], 30.0, atol=1.0)


def test_a_model_that_is_refused_leaves_the_robot_as_it_was(paper):
    robot = LiveRobot(paper, "planar")
    robot.advance(AHEAD, 0.5)
    with pytest.raises(EffectRefusedError):
        robot.change(paper.with_effect("low_grip", friction=0.2))
    assert robot.advance(AHEAD, 0.1).twist[0] > 0.5


def test_a_reset_is_the_start(paper, plant):
    robot = LiveRobot(paper, plant)
    first = robot.advance(AHEAD, 0.5)
    robot.reset()
    np.testing.assert_array_equal(robot.advance(AHEAD, 0.5).pose, first.pose)


def test_every_effect_that_is_offered_can_be_switched_on(paper, plant):
    choices = choices_for(paper, plant, measured=False)
    robot = LiveRobot(paper, plant)
    for choice in choices:
        robot.change(with_effects(paper, choices, [choice.name]))
        robot.advance(AHEAD, 0.1)
    assert len(choices) >= 8


def test_the_models_effects_are_offered_first_and_on(paper):
    model = paper.with_effect("backlash", "spring", gap_deg=3.0)
    choices = choices_for(model, "rollers", measured=False)
    assert first_on(choices) == {"backlash/spring"}
    assert [choice.name for choice in choices if choice.name.startswith("backlash")] == ["backlash/spring"]


def test_a_sensors_effect_says_why_driving_does_not_show_it(paper):
    model = paper.with_effect("sensor_latency", delay_s=0.1)
    (choice,) = (c for c in choices_for(model, "rollers", measured=False) if c.in_model)
    assert "replay" in choice.why_not
    assert first_on([choice]) == frozenset()


def test_differences_between_wheels_are_not_offered_for_one_wheel(paper):
    names = [choice.name for choice in choices_for(paper, "bench", measured=True)]
    assert "wheel_gain_mismatch" not in names
    assert "backlash" in names


def test_what_is_offered_is_in_the_order_of_the_chain(paper):
    names = [choice.name for choice in choices_for(paper, "rollers", measured=False)]
    assert names == [name for name in CATALOGUE if name in names]


def test_a_robot_that_is_no_mecanum_robot_is_refused(paper):
    from dataclasses import replace

    from mecanum_env.kinematics import mecanum_wheels

    wheels = mecanum_wheels(paper.robot)[:3]
    with pytest.raises(InputError):
        LiveRobot(replace(paper, robot=replace(paper.robot, wheels=wheels)))
