"""Kinematics: signs, inverses, saturation policies, leading axes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from mecanum_env import kinematics as kin
from mecanum_env import omni
from mecanum_env.errors import InputError
from mecanum_env.model import Robot
from mecanum_env.omni import OmniWheel
from mecanum_env.units import RAD_S_PER_RPM

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


SIZES = st.floats(0.05, 0.5)
THREE_TO_SIX = st.integers(3, 6).flatmap(
    lambda n: st.tuples(
        st.lists(st.floats(-40.0 / n, 40.0 / n), min_size=n, max_size=n),
        st.lists(SIZES, min_size=n, max_size=n),
        st.lists(st.floats(0.02, 0.2), min_size=n, max_size=n),
    )
)


@given(THREE_TO_SIX, TWISTS)
def test_a_twist_survives_any_number_of_omni_wheels(sizes, twist):
    n = len(sizes[0])
    wheels = tuple(
        OmniWheel(str(i), 360.0 * i / n + off, distance, radius)
        for i, (off, distance, radius) in enumerate(zip(*sizes, strict=True))
    )
    robot = Robot(wheels=wheels)
    speeds = kin.twist_to_wheels(twist, robot)
    assert speeds.shape == (*twist.shape[:-1], n)
    np.testing.assert_allclose(kin.wheels_to_twist(speeds, robot), twist, atol=1e-9)


@given(SIZES, SIZES, TWISTS)
def test_four_mecanum_wheels_are_the_special_case_of_rollers_at_45_degrees(x, y, twist):
    robot = Robot(half_wheelbase_m=x, half_track_m=y)
    wheels = kin.mecanum_wheels(robot)
    speeds = kin.twist_to_wheels(twist, robot)
    np.testing.assert_allclose(omni.twist_to_speeds(twist, wheels), speeds, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(
        omni.speeds_to_twist(speeds, wheels), kin.wheels_to_twist(speeds, robot), rtol=1e-11, atol=1e-11
    )


@given(SIZES, SIZES, TWISTS)
def test_the_mecanum_robot_keeps_the_bits_of_its_own_equations(x, y, twist):
    robot = Robot(half_wheelbase_m=x, half_track_m=y)
    vx, vy, turn = twist[..., 0], twist[..., 1], (x + y) * twist[..., 2]
    rim = np.stack([vx - vy - turn, vx + vy + turn, vx + vy - turn, vx - vy + turn], axis=-1)
    own = rim / (robot.wheel_radius_m * RAD_S_PER_RPM)
    assert np.array_equal(kin.twist_to_wheels(twist, robot), own)


def test_three_omni_wheels_turn_as_drawn():
    """A robot on wheels at 60, 180 and 300 degrees: forward uses the two in front, against each other."""
    wheels = [OmniWheel(str(a), a, 0.135, 0.04) for a in (60.0, 180.0, 300.0)]
    rim = np.array(omni.twist_to_speeds([[1, 0, 0], [0, 1, 0], [0, 0, 1]], wheels)) * 0.04 * RAD_S_PER_RPM
    half = math.sqrt(3) / 2
    np.testing.assert_allclose(rim, [[-half, 0, half], [0.5, -1, 0.5], [0.135] * 3], atol=1e-15)


@pytest.mark.parametrize(
    "wheels",
    [
        [OmniWheel("a", 0, 0.1, 0.05), OmniWheel("b", 180, 0.1, 0.05)],
        [
            OmniWheel(name, angle, 0.1, 0.05, drive_deg=0.0)
            for name, angle in (("a", 0), ("b", 90), ("c", 180))
        ],
        [OmniWheel(name, 120.0 * i, 0.1, 0.05) for i, name in enumerate("aab")],
    ],
)
def test_wheels_that_cannot_drive_every_motion_are_refused(wheels):
    with pytest.raises(InputError, match=r"cannot drive the body|two wheels have the name"):
        Robot(wheels=tuple(wheels))


def test_what_is_of_mecanum_wheels_alone_says_so():
    robot = Robot(wheels=tuple(OmniWheel(str(i), 120.0 * i, 0.1, 0.05) for i in range(3)))
    with pytest.raises(
        InputError, match=r"robot\.wheels lists 3 wheels, but the commands V, theta, VC are of four"
    ):
        kin.twist_to_command([1.0, 0.0, 0.0], robot)
