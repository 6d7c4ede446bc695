"""The passive plugin "mecanum.rollers": friction along a body's y, wherever that points; what it refuses."""

import math

import mujoco
import numpy as np
import pytest

from mecanum_env.mjcf import planar_spec
from mecanum_env.mjcf.plants import mjcf_text
from mecanum_env.model import paper_model

JOINTS = (
    '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>'
)


def body_xml(user: str = "6 2 0.3 0.01", joints: str = JOINTS, size: int = 4, plugin: str = "rollers") -> str:
    return f"""<mujoco>
      <option integrator="implicitfast" timestep="0.001"/>
      <size nuser_body="{size}"/>
      <extension><plugin plugin="mecanum.rollers"><instance name="rollers"/></plugin></extension>
      <worldbody>
        <body name="base" user="{user}" gravcomp="1">
          {joints}
          <inertial pos="0 0 0" mass="2" diaginertia="0.1 0.1 0.1"/>
          <plugin instance="{plugin}"/>
        </body>
      </worldbody>
    </mujoco>"""


@pytest.mark.parametrize("yaw_deg", [0.0, 35.0, 180.0])
def test_it_holds_the_front_and_the_rear_wheels_back_sideways(yaw_deg):
    model = mujoco.MjModel.from_xml_string(body_xml())
    data, yaw = mujoco.MjData(model), math.radians(yaw_deg)
    forward, left, turn = 0.7, 0.4, 0.5
    data.qpos[2] = yaw
    cos, sin = math.cos(yaw), math.sin(yaw)
    data.qvel[:] = cos * forward - sin * left, sin * forward + cos * left, turn
    mujoco.mj_forward(model, data)
    front, rear = (2.0 * (6.0 * np.sign(v) + 2.0 * v) for v in (left + 0.3 * turn, left - 0.3 * turn))
    held = -(front + rear)
    np.testing.assert_allclose(data.qfrc_passive, [-sin * held, cos * held, -0.3 * (front - rear)], atol=1e-9)


def test_a_robot_comes_to_rest_sideways_and_does_not_turn_round():
    model = mujoco.MjModel.from_xml_string(body_xml("6 0 0.3 0.012"))
    data = mujoco.MjData(model)
    data.qvel[:] = 1.0, 0.5, 0.0
    speeds = []
    for _ in range(300):
        mujoco.mj_step(model, data)
        speeds.append(data.qvel[1])
    # 24 N brake 2 kg from 0.5 m/s in 42 ms; forward nothing does.
    assert data.qvel[0] == pytest.approx(1.0, abs=1e-9)
    assert speeds[35] > 0.02 > speeds[60] > -1e-9
    assert np.all(np.diff(speeds) <= 1e-12)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"user": "6 2 0.3", "size": 3}, "nuser_body = 3, must be at least 4"),
        ({"user": "-1 2 0.3 0.01"}, "friction of -1 N and 2 N s/m, must be finite and not below 0"),
        ({"user": "6 2 0.3 0"}, "the speed from which the friction is whole = 0 m/s"),
        ({"joints": "<freejoint/>"}, "must be slides along x and y and a hinge about z"),
    ],
)
@pytest.mark.usefixtures("in_tmp_path")
def test_what_it_cannot_be_is_refused(changed, message):
    with pytest.raises(ValueError, match=message):
        mujoco.MjModel.from_xml_string(body_xml(**changed))


def test_a_written_planar_plant_has_it_and_one_without_friction_has_not():
    plain = mjcf_text(planar_spec(paper_model()))
    rough = mjcf_text(planar_spec(paper_model().with_effect("roller_friction", torque_n_m=0.05)))
    assert "mecanum.rollers" not in plain
    model = mujoco.MjModel.from_xml_string(rough)
    assert model.body_user[model.body("base").id, 0] > 0.0
    data = mujoco.MjData(model)
    data.qvel[1] = 0.3
    mujoco.mj_forward(model, data)
    assert data.qfrc_passive[1] < 0.0
