"""Kinematics: signs, inverses, saturation policies, leading axes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from mecanum_env import kinematics as kin
from mecanum_env.model import Robot

ROBOT = Robot()
RPM = st.floats(-200.0, 200.0)
TWISTS = arrays(
    float, array_shapes(min_dims=0, max_dims=2, max_side=4).map(lambda s: (*s, 3)), elements=st.floats(-5, 5)
)
WHEEL_SPEEDS = arrays(
    float, array_shapes(min_dims=0, max_dims=2, max_side=4).map(lambda s: (*s, 4)), elements=RPM
)


@pytest.mark.parametrize(
    ("command", "signs"),
    [
        ((50, 0, 0), (1, 1, 1, 1)),  # forward
        ((50, 90, 0), (-1, 1, 1, -1)),  # left
        ((50, 180, 0), (-1, -1, -1, -1)),  # backward
        ((50, -90, 0), (1, -1, -1, 1)),  # right
        ((0, 0, 50), (-1, 1, -1, 1)),  # counter-clockwise
    ],
)
def test_wheels_turn_the_way_the_command_says(command, signs):
    np.testing.assert_allclose(kin.command_to_wheels(*command), 50.0 * np.array(signs), atol=1e-12)


@pytest.mark.parametrize(("wheels", "axis"), [((1, 1, 1, 1), 0), ((-1, 1, 1, -1), 1), ((-1, 1, -1, 1), 2)])
def test_forward_left_and_counter_clockwise_are_positive_and_alone(wheels, axis):
    twist = kin.wheels_to_twist(60.0 * np.array(wheels), ROBOT)
    surface_m_s = 2.0 * math.pi * ROBOT.wheel_radius_m  # 60 rpm is one turn a second
    expected = np.zeros(3)
    expected[axis] = surface_m_s if axis < 2 else surface_m_s / (ROBOT.half_wheelbase_m + ROBOT.half_track_m)
    np.testing.assert_allclose(twist, expected, atol=1e-14)


@given(v=st.floats(1e-3, 200.0), theta=st.floats(-179.999, 180.0), vc=RPM)
def test_command_survives_the_wheels(v, theta, vc):
    v_back, theta_back, vc_back = kin.wheels_to_command(kin.command_to_wheels(v, theta, vc))
    assert v_back == pytest.approx(v, rel=1e-9)
    assert vc_back == pytest.approx(vc, abs=1e-10)
    turn = (theta_back - theta + 180.0) % 360.0 - 180.0
    assert turn == pytest.approx(0.0, abs=1e-7)


@given(TWISTS)
def test_twist_survives_wheels_and_command(twist):
    np.testing.assert_allclose(
        kin.wheels_to_twist(kin.twist_to_wheels(twist, ROBOT), ROBOT), twist, atol=1e-12
    )
    command = kin.twist_to_command(twist, ROBOT)
    np.testing.assert_allclose(kin.command_to_twist(*command, ROBOT), twist, atol=1e-12)


@given(WHEEL_SPEEDS)
def test_wheels_lose_only_the_part_in_which_they_work_against_each_other(wheels):
    kept = kin.twist_to_wheels(kin.wheels_to_twist(wheels, ROBOT), ROBOT)
    against = np.array([1.0, 1.0, -1.0, -1.0])  # orthogonal to forward, left and turning
    np.testing.assert_allclose(kept, wheels - (wheels @ against)[..., None] / 4.0 * against, atol=1e-10)


@given(WHEEL_SPEEDS)
def test_leading_axes_are_independent(wheels):
    rows = wheels.reshape(-1, 4)
    twists = kin.wheels_to_twist(wheels, ROBOT).reshape(-1, 3)
    for row, twist in zip(rows, twists, strict=True):
        np.testing.assert_allclose(kin.wheels_to_twist(row, ROBOT), twist, atol=1e-12)


def test_commands_broadcast():
    assert kin.command_to_wheels(np.ones((3, 1)), np.zeros(5), 2.0).shape == (3, 5, 4)


def test_a_robot_at_rest_has_direction_zero_and_backward_is_180_not_minus_180():
    _, theta, _ = kin.wheels_to_command([[-0.0] * 4, [0.0] * 4, [-1.0] * 4])
    assert theta.tolist() == [0.0, 0.0, 180.0]


@given(WHEEL_SPEEDS, st.floats(0.1, 200.0))
def test_clipping_treats_each_wheel_by_itself(wheels, limit):
    clipped = kin.clip_wheels(wheels, limit)
    within = np.abs(wheels) <= limit
    assert np.array_equal(clipped[within], wheels[within])
    assert np.array_equal(clipped[~within], np.copysign(limit, wheels[~within]))


@given(WHEEL_SPEEDS, st.floats(0.1, 200.0))
def test_scaling_keeps_the_direction_and_touches_only_what_is_too_fast(wheels, limit):
    scaled = kin.scale_wheels(wheels, limit)
    assert np.all(np.abs(scaled) <= limit)
    for before, after in zip(wheels.reshape(-1, 4), scaled.reshape(-1, 4), strict=True):
        largest = np.max(np.abs(before))
        if largest <= limit:
            assert np.array_equal(before, after)
        else:
            np.testing.assert_allclose(after * largest, before * limit, rtol=1e-12, atol=1e-300)


def test_no_limit_changes_nothing():
    wheels = np.array([1.0, -500.0, 3.0, 1e6])
    assert np.array_equal(kin.scale_wheels(wheels, math.inf), wheels)
    assert np.array_equal(kin.clip_wheels(wheels, math.inf), wheels)


def test_the_two_policies_differ_when_one_wheel_saturates():
    wheels = kin.command_to_wheels(100.0, 30.0, 20.0)
    _, clipped_direction, _ = kin.wheels_to_command(kin.clip_wheels(wheels, 100.0))
    _, scaled_direction, _ = kin.wheels_to_command(kin.scale_wheels(wheels, 100.0))
    assert scaled_direction == pytest.approx(30.0)
    assert abs(clipped_direction - 30.0) > 0.5


def test_commands_are_rounded_to_what_the_robot_takes():
    v, theta, vc = kin.round_command(10.4, 30.6, -7.6, 1.0)
    assert (float(v), float(theta), float(vc)) == (10.0, 31.0, -8.0)
    v, theta, vc = kin.round_command(10.4, 30.6, -7.6, 0.0)
    assert (float(v), float(theta), float(vc)) == (10.4, 30.6, -7.6)
