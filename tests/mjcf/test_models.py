from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.errors import InputError
from mecanum_env.kinematics import WHEELS, command_to_wheels
from mecanum_env.law import WheelLaw
from mecanum_env.mjcf import bench_spec, fitting_timestep, planar_spec, robot_spec
from mecanum_env.model import paper_model
from mecanum_env.plugin.layout import LOST_VOLTAGE
from mecanum_env.units import RAD_S_PER_RPM
from sysid.studies.motion import start

SPECS = [robot_spec, planar_spec, bench_spec]


@pytest.mark.parametrize("plant", ["rollers", "planar"])
def test_the_names_that_programs_rely_on(plant, request):
    mj_model = request.getfixturevalue(plant)
    wheels = [f"wheel_{wheel}" for wheel in WHEELS]
    assert [mj_model.actuator(i).name for i in range(mj_model.nu)] == wheels
    assert {"base_velocity", "base_gyro", "base_accelerometer", "base_position", "base_orientation"} < {
        mj_model.sensor(i).name for i in range(mj_model.nsensor)
    }
    for name in ("track", "overview"):
        assert mj_model.camera(name).id >= 0
    joints = {"base_x", "base_y", "base_yaw"} if plant == "planar" else {"base", "rocker", *wheels}
    assert joints <= {mj_model.joint(i).name for i in range(mj_model.njnt)}
    assert mj_model.body("base").id == 1


@pytest.mark.parametrize("spec", SPECS)
def test_an_effect_that_cannot_be_that_large_is_refused_by_name(spec):
    with pytest.raises(InputError, match=r"effects\.battery_sag\.per_volt = -0\.1, must be"):
        spec(paper_model().with_effect("battery_sag", per_volt=-0.1))


@pytest.mark.parametrize("spec", SPECS)
def test_there_is_room_for_the_voltage_of_the_supply(spec):
    assert spec(paper_model()).compile().nuserdata == LOST_VOLTAGE + 1


def test_command_latency_goes_to_the_drive(packaged):
    mj_model = bench_spec(packaged.with_effect("command_latency", delay_s=0.04)).compile()
    assert mj_model.actuator("wheel").user[1] == 0.04


def test_the_wheel_quantum_can_be_left_to_the_program(packaged):
    assert bench_spec(packaged).compile().actuator("wheel").dynprm[8] == 1.0
    assert bench_spec(packaged, wheel_quantum=False).compile().actuator("wheel").dynprm[8] == 0.0


def test_each_wheel_runs_its_own_law(packaged):
    slow = WheelLaw(0.9, 0.0, 0.0, 0.1, 0.0, 0.0, packaged.wheel.law.sample_period_s)
    model = replace(packaged, wheels={"rl": slow})
    for spec in (robot_spec, planar_spec):
        compiled = spec(model).compile()
        assert compiled.actuator("wheel_rl").dynprm[0] == 0.9
        assert compiled.actuator("wheel_fr").dynprm[0] == packaged.wheel.law.A
    assert bench_spec(model, wheel="rl").compile().actuator("wheel").dynprm[0] == 0.9


@given(st.floats(1e-3, 0.2), st.floats(1e-4, 0.1))
def test_the_sample_period_is_a_whole_number_of_steps(period, at_most):
    model = paper_model()
    law = replace(model.wheel.law, sample_period_s=period)
    step = fitting_timestep(replace(model, wheel=replace(model.wheel, law=law)), at_most)
    assert step <= at_most * (1 + 1e-8)
    assert period / step == pytest.approx(round(period / step), abs=1e-9)
    assert step > at_most / 2 or step == period


@pytest.mark.parametrize("at_most", [0.0, -1.0, np.nan, np.inf])
def test_an_impossible_timestep_is_refused(packaged, at_most):
    with pytest.raises(InputError, match="timestep_s"):
        robot_spec(packaged, at_most)


def test_all_four_wheels_stand_on_the_floor(packaged, rollers):
    data = start(rollers, settle_s=0.5)
    load = dict.fromkeys(WHEELS, 0.0)
    force = np.empty(6)
    for i in range(data.ncon):
        names = [rollers.geom(g).name for g in data.contact[i].geom]
        (roller,) = [name for name in names if name != "floor"]
        mujoco.mj_contactForce(rollers, data, i, force)
        load[roller.split("_")[1]] += force[0]
    weight = packaged.robot.mass_kg * 9.81
    assert sum(load.values()) == pytest.approx(weight, rel=0.01)
    for wheel in WHEELS:
        assert load[wheel] == pytest.approx(weight / 4, rel=0.1)


def test_sparse_equals_dense(packaged, rollers):
    """MuJoCo 4.0.0 factorises some sparse trees wrongly; on this robot both ways accelerate alike."""
    dense = robot_spec(packaged).compile()
    dense.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    assert rollers.opt.jacobian == mujoco.mjtJacobian.mjJAC_SPARSE
    data, other = mujoco.MjData(rollers), mujoco.MjData(dense)
    spec = mujoco.mjtState.mjSTATE_INTEGRATION
    state = np.empty(mujoco.mj_stateSize(rollers, spec))
    rng = np.random.default_rng(0)
    for _ in range(20):
        data.ctrl[:] = command_to_wheels(rng.uniform(0, 60), rng.uniform(-180, 180), rng.uniform(-40, 40))
        mujoco.mj_step(rollers, data, 24)
        mujoco.mj_getState(rollers, data, state, spec)
        mujoco.mj_setState(dense, other, state, spec)
        mujoco.mj_forward(rollers, data)
        mujoco.mj_forward(dense, other)
        scale = np.abs(data.qacc).max()
        np.testing.assert_allclose(other.qacc, data.qacc, atol=1e-6 * scale)


def test_the_bench_wheel_follows_the_law_but_for_the_servos_give(packaged):
    """The lag is the torque that turns the wheel over the servo's stiffness, and passes with it."""
    mj_model = bench_spec(packaged).compile()
    data = mujoco.MjData(mj_model)
    data.ctrl[0] = 130.0
    law = packaged.wheel.law.simulate(np.full(120, 130.0))
    speeds = []
    for _ in range(120):
        mujoco.mj_step(mj_model, data, 4)
        speeds.append(data.qvel[0] / RAD_S_PER_RPM)
    inertia = mj_model.dof_M0[0]
    steepest = np.abs(np.diff(law)).max() / packaged.wheel.law.sample_period_s
    assert np.abs(speeds - law[1:]).max() <= inertia * steepest / packaged.robot.servo_n_m_s_rad
    assert speeds[-1] == pytest.approx(130.0, abs=1e-5)


def test_planar_wheel_speeds_are_those_of_no_slip(planar):
    data = mujoco.MjData(planar)
    data.ctrl[:] = command_to_wheels(50, 70, -30)
    mujoco.mj_step(planar, data, 480)
    mujoco.mj_forward(planar, data)
    wheels = [data.sensor(f"wheel_{wheel}_speed").data[0] for wheel in WHEELS]
    np.testing.assert_allclose(np.array(wheels) / RAD_S_PER_RPM, data.ctrl, atol=0.5 + 1e-6)
    gears = np.array([planar.actuator(f"wheel_{wheel}").gear[[0, 1, 5]] for wheel in WHEELS])
    twist = [*data.sensor("base_velocity").data[:2], data.sensor("base_gyro").data[2]]
    np.testing.assert_allclose(wheels, gears @ twist, atol=1e-12)
