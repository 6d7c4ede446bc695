import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.kinematics import WHEELS, twist_to_wheels
from mecanum_env.mjcf.geometry import (
    ROLLER_SIDE,
    no_slip_rows,
    roller_angle,
    roller_pose,
    sideways_ratio,
    wheel_geometry,
    wheel_position,
)
from mecanum_env.model import Robot
from mecanum_env.units import RAD_S_PER_RPM

radii = st.floats(0.01, 0.3)
counts = st.integers(4, 24)


@given(radii, counts)
def test_the_envelope_is_round_where_the_load_passes_on(radius, rollers):
    geometry = wheel_geometry(radius, rollers)
    reach = geometry.reach(np.array([0.0, np.pi / rollers, -np.pi / rollers]))
    np.testing.assert_allclose(reach, radius, rtol=1e-12)


@given(radii, counts)
def test_between_rollers_the_envelope_bulges_less_than_with_any_fewer(radius, rollers):
    angles = np.linspace(0, np.pi / rollers, 101)
    bulge = wheel_geometry(radius, rollers).reach(angles) - radius
    assert bulge.min() >= -1e-12 * radius
    # 0.23 % of the radius for eight rollers, falling with the square of their number; none for fewer.
    assert bulge.max() < (0.0172 * radius * (4 / rollers) ** 2 if rollers >= 8 else 1e-12)


@given(radii, counts)
def test_rollers_do_not_overlap(radius, rollers):
    """Points on the surface of one roller lie outside its neighbour."""
    geometry = wheel_geometry(radius, rollers)
    b, c = geometry.roller_radius, geometry.roller_half_length
    u, v = np.meshgrid(np.linspace(0, np.pi, 60), np.linspace(0, 2 * np.pi, 60))
    surface = np.stack([b * np.sin(u) * np.cos(v), b * np.sin(u) * np.sin(v), c * np.cos(u)]).reshape(3, -1)
    (p0, q0), (p1, q1) = (roller_pose(geometry, 1.0, 2 * np.pi / rollers * i) for i in range(2))
    inside = rotation(q1).T @ (rotation(q0) @ surface + np.subtract(p0, p1)[:, None])
    level = (inside[0] / b) ** 2 + (inside[1] / b) ** 2 + (inside[2] / c) ** 2
    assert level.min() > 1.0


def rotation(quaternion):
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_the_packaged_wheel_has_plausible_sizes():
    geometry = wheel_geometry(0.0762, 10)
    assert geometry.roller_circle == pytest.approx(0.0619, abs=1e-4)
    assert geometry.roller_radius == pytest.approx(0.0143, abs=1e-4)
    assert geometry.roller_half_length == pytest.approx(0.0470, abs=1e-4)


@pytest.mark.parametrize("wheel", WHEELS)
def test_the_lowest_roller_lies_at_45_degrees_as_in_an_x(wheel):
    position, quaternion = roller_pose(wheel_geometry(0.1, 10), ROLLER_SIDE[wheel], 0.0)
    axis = rotation(quaternion)[:, 2]
    np.testing.assert_allclose(position[:2], 0.0, atol=1e-15)
    np.testing.assert_allclose(axis, np.array([1.0, ROLLER_SIDE[wheel], 0.0]) / np.sqrt(2), atol=1e-15)
    # Seen from above, the rollers on top form an X, so those on the floor a rhombus: axes along x y < 0.
    x, y = wheel_position(Robot(), wheel)
    assert np.sign(x * y) == -np.sign(axis[0] * axis[1])


def test_no_two_wheels_pass_their_load_on_at_once():
    geometry = wheel_geometry(0.1, 10)
    pitch = 2 * np.pi / geometry.rollers
    phases = np.sort([roller_angle(geometry, wheel, 0) / pitch % 1 for wheel in WHEELS])
    np.testing.assert_allclose(np.diff(phases), 0.25)


@pytest.mark.parametrize("rollers", [8, 24])
def test_the_rows_differ_from_the_ideal_kinematics_by_the_rollers_give_alone(rollers):
    robot = Robot(rollers_per_wheel=rollers)
    ideal = np.array([twist_to_wheels(row, robot) for row in np.eye(3)]).T * RAD_S_PER_RPM
    give = 1 / sideways_ratio(rollers) - 1
    difference = no_slip_rows(robot) - ideal
    np.testing.assert_allclose(difference[:, 0], 0.0, atol=1e-12)
    np.testing.assert_allclose(difference[:, 1], give * ideal[:, 1], rtol=1e-9)
    # In yaw, sideways motion is what the wheelbase causes, not what the track does.
    share = robot.half_wheelbase_m / (robot.half_wheelbase_m + robot.half_track_m)
    np.testing.assert_allclose(difference[:, 2], give * share * ideal[:, 2], rtol=1e-9)


def test_wheels_give_sideways_what_the_mean_of_the_cosine_says():
    rows = no_slip_rows(Robot())
    forward, sideways = np.linalg.lstsq(rows, np.ones(4), rcond=None)[0][:1], rows[1, 0] / rows[1, 1]
    assert forward[0] == pytest.approx(0.0762)
    angle = np.linspace(-np.pi / 10, np.pi / 10, 100_001)
    assert sideways == pytest.approx(np.mean(np.cos(angle)), rel=1e-5)
