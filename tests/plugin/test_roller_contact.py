"""Rollers that touch the floor as barrels: their shape, and that wheels of few of them are round."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.mjcf.geometry import wheel_geometry
from mecanum_env.model import paper_model
from mecanum_env.simulator import BodyCommands, drive

RADIUS = 0.05


def on_floor(size: tuple[float, float, float], user: tuple[float, ...], quat: np.ndarray) -> mujoco.MjData:
    """Return a roller with its middle 1 mm above the floor."""
    marked = f'user="{" ".join(map(repr, user))}"' if user else ""
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <size nuser_geom="{len(user)}"/>
      <worldbody>
        <geom type="plane" size="1 1 1"/>
        <body pos="0.1 0.2 0.001">
          <freejoint/>
          <geom type="ellipsoid" size="{size[0]!r} {size[1]!r} {size[2]!r}" {marked}/>
        </body>
      </worldbody>
    </mujoco>""")
    data = mujoco.MjData(model)
    data.qpos[3:] = quat / np.linalg.norm(quat)
    mujoco.mj_forward(model, data)
    return data


quaternions = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1).map(np.array)


@given(st.integers(4, 7), quaternions)
def test_a_barrel_touches_the_floor_with_its_lowest_point(rollers, quat):
    wheel = wheel_geometry(RADIUS, rollers)
    data = on_floor((wheel.roller_radius, wheel.roller_radius, wheel.roller_half_length), wheel.barrel, quat)
    # Its profile, from the radius of the envelope alone: it is where its support function has its slopes.
    circle, end = wheel.barrel
    latitude = np.linspace(-np.arcsin(end), np.arcsin(end), 4001)
    reach = RADIUS - circle * np.sqrt(1.0 - 2.0 * np.sin(latitude) ** 2)
    slope = np.gradient(reach, latitude, edge_order=2)
    along = reach * np.sin(latitude) + slope * np.cos(latitude)
    out = reach * np.cos(latitude) - slope * np.sin(latitude)
    axis = data.geom_xmat[1].reshape(3, 3)[:, 2]
    lowest = 0.001 + along * axis[2] - out * np.sqrt(max(0.0, 1.0 - axis[2] ** 2))
    contact = data.contact[0]
    assert data.ncon == 1
    assert contact.dist == pytest.approx(lowest.min(), abs=1e-7)
    np.testing.assert_allclose(contact.frame[:3], [0.0, 0.0, 1.0], atol=1e-12)
    # Half of the depth below the floor, on the surface where that is lowest.
    assert contact.pos[2] == pytest.approx(contact.dist / 2, abs=1e-9)
    place = (contact.pos - [0.1, 0.2, 0.001]) @ axis + contact.dist / 2 * axis[2]
    flat = np.abs(lowest - lowest.min()) < 2e-7
    assert along[flat].min() - 1e-4 < place < along[flat].max() + 1e-4


@given(quaternions)
def test_other_ellipsoids_collide_as_before(quat):
    data = on_floor((0.01, 0.02, 0.03), (), quat)
    down = data.geom_xmat[1].reshape(3, 3)[2]
    assert data.contact[0].dist == pytest.approx(0.001 - np.linalg.norm(down * [0.01, 0.02, 0.03]), abs=1e-6)


@pytest.mark.parametrize("rollers", [4, 5, 7])
def test_wheels_of_few_rollers_roll_as_round_as_those_of_many(rollers):
    few, many = (
        drive(replace(model, robot=replace(model.robot, rollers_per_wheel=n)), BodyCommands.constant(60), 1.5)
        for model in (paper_model(),)
        for n in (rollers, 10)
    )
    assert np.std(few.qpos[-480:, 2]) < np.std(many.qpos[-480:, 2])


def test_a_weak_robot_on_four_rollers_climbs_nothing():
    model = paper_model()
    weak = replace(model.robot, rollers_per_wheel=4, torque_limit_n_m=0.15, servo_n_m_s_rad=0.1)
    rolling, ideal = (
        drive(replace(model, robot=weak), BodyCommands.constant(40), 6.0, plant=plant)
        for plant in ("rollers", "planar")
    )
    assert rolling.twist[-1, 0] == pytest.approx(ideal.twist[-1, 0], rel=0.02)
