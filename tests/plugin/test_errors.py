"""What the plugin refuses, in which words, and that edits of a running model never crash."""

import mujoco
import numpy as np
import pytest

from mecanum_env.errors import InputError, UnstableLawError
from mecanum_env.plugin.layout import SERVO, drive_state, require_valid, write_parameters
from mecanum_env.wheel_drive.parameters import DYNPRM, USER

pytestmark = pytest.mark.usefixtures("in_tmp_path")

BAD_DYNPRM = [
    ("A", np.nan, "A = dynprm"),
    ("F", np.inf, "F = dynprm"),
    ("A", 1.5, "unstable"),
    ("C", -1.0, "unstable"),
    ("sample_period_s", 0.0, "sample_period_s"),
    ("sample_period_s", -0.01, "sample_period_s"),
    ("sample_period_s", np.nan, "sample_period_s"),
    ("sample_period_s", 1e-7, "timestep"),
    ("command_period_s", 0.0, "command_period_s"),
    ("command_period_s", np.inf, "command_period_s"),
    ("command_period_s", 1e-6, "timestep"),
    ("command_quantum_rpm", -1.0, "command_quantum_rpm"),
    ("command_quantum_rpm", np.nan, "command_quantum_rpm"),
    ("saturation_rpm", -1.0, "saturation_rpm"),
    ("saturation_rpm", np.inf, "saturation_rpm"),
]
BAD_USER = [
    ("servo_integral_n_m_rad", -1.0),
    ("servo_integral_n_m_rad", np.nan),
    ("servo_windup", -0.1),
    ("servo_windup", 1.1),
    ("windup", -0.1),
    ("windup", 1.1),
    ("delay_s", -0.1),
    ("delay_s", 7.0),
    ("delay_s", np.nan),
    ("torque_limit_n_m", 0.0),
    ("torque_limit_n_m", -1.0),
    ("torque_limit_n_m", np.nan),
    ("deadband_rpm", -1.0),
    ("gain", -0.5),
    ("reverse_ratio", np.nan),
    ("drop_per_s", np.inf),
    ("softness_rpm", -1.0),
    ("acceleration_rpm_s", -1.0),
    ("gap_rad", -0.1),
    ("breakaway_n_m", -1.0),
    ("stribeck_rad_s", np.nan),
    ("subtracted_rpm", -1.0),
    ("warm_up_share", 1.0),
    ("warm_up_share", np.nan),
    ("warm_up_s", -1.0),
    ("brake_rpm_s", -1.0),
    ("jerk_rpm_s2", np.nan),
    ("jitter_s", -0.1),
    ("jitter_s", 7.0),
    ("jitter_s", np.nan),
    ("loss", 1.1),
    ("loss", np.nan),
    ("link_seed", -1.0),
    ("map_knots", 7.0),
    ("map_knots", 1.5),
    ("map_knots", np.nan),
    ("knot_1_rpm", np.inf),
    ("drive_acceleration_rpm_s", -1.0),
    ("supply_rpm", np.inf),
    ("rotor_kg_m2", -0.1),
    ("friction_warm_share", np.nan),
    ("ripple_phase_rad", np.inf),
    ("gap_kind", -1.0),
]
BAD_SERVO = [5.0, 0.0, np.nan, -np.inf]


@pytest.fixture
def mjmodel(compile_wheels, free_model):
    return compile_wheels(free_model())


@pytest.fixture
def spec(wheels_spec, free_model):
    return wheels_spec(free_model())


def refused(spec, *words: str) -> None:
    with pytest.raises(ValueError, match='actuator "wheel_0"') as caught:
        spec.compile()
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(("name", "value", "word"), BAD_DYNPRM)
def test_bad_parameters_do_not_compile(spec, name, value, word):
    values = np.array(spec.actuators[0].dynprm)
    values[DYNPRM.index(name)] = value
    spec.actuators[0].dynprm = values
    refused(spec, word)


@pytest.mark.parametrize(("name", "value"), BAD_USER)
def test_bad_user_values_do_not_compile(spec, name, value):
    values = np.array(spec.actuators[0].userdata)
    values[USER.index(name)] = value
    spec.actuators[0].userdata = values
    refused(spec, f"{name} = user[{USER.index(name)}]")


@pytest.mark.parametrize("bias", BAD_SERVO)
def test_a_servo_without_stiffness_does_not_compile(spec, bias):
    spec.actuators[0].biasprm = [0.0, 0.0, bias] + [0.0] * 7
    refused(spec, "servo_n_m_s_rad")


def test_a_servo_without_affine_bias_does_not_compile(spec):
    spec.actuators[0].biastype = mujoco.mjtBias.mjBIAS_NONE
    refused(spec, 'biastype="affine"')


def test_native_dynamics_and_delay_do_not_compile(wheels_spec, free_model):
    spec = wheels_spec(free_model())
    spec.actuators[0].dyntype = mujoco.mjtDyn.mjDYN_FILTER
    refused(spec, "dyntype")
    spec = wheels_spec(free_model())
    spec.actuators[0].nsample, spec.actuators[0].delay = 10, 0.01
    refused(spec, "nsample")


def test_mujocos_own_force_limit_does_not_compile(spec):
    spec.actuators[0].forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
    spec.actuators[0].forcerange = [-1.5, 1.5]
    refused(spec, "forcerange", "user[2]")


XML = """
<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  {size}
  <default><general biastype="affine" biasprm="0 0 -5"/></default>
  <extension><plugin plugin="mecanum.wheel">{instances}</plugin></extension>
  <worldbody>
    <body><joint name="one" axis="0 1 0"/><geom size="0.1" mass="1"/></body>
    <body><joint name="two" axis="0 1 0"/><geom size="0.1" mass="1"/></body>
  </worldbody>
  <actuator>{actuators}</actuator>
</mujoco>
"""
LAW = 'dynprm="0.881 -0.151 0.122 0.0744 0.1484 -0.0748 0.01 0.1 1 135"'
LIMIT = 'user="0 0 1.5"'
SIZE = '<size nuser_actuator="16"/>'


def load(size: str = SIZE, instances: str = "", actuators: str = "") -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(XML.format(size=size, instances=instances, actuators=actuators))


def test_a_handwritten_file_drives():
    mjmodel = load(actuators=f'<plugin name="w" joint="one" plugin="mecanum.wheel" {LAW} {LIMIT}/>')
    data = mujoco.MjData(mjmodel)
    data.ctrl[0] = 30.0
    mujoco.mj_step(mjmodel, data, 1000)
    assert data.qvel[0] == pytest.approx(np.pi, abs=1e-6)


def test_missing_user_fields_are_named():
    with pytest.raises(ValueError, match='actuator "w": nuser_actuator = 0, must be at least 3'):
        load(size="", actuators=f'<plugin name="w" joint="one" plugin="mecanum.wheel" {LAW}/>')


def test_a_forgotten_torque_limit_is_named():
    with pytest.raises(ValueError, match=r'actuator "w": torque_limit_n_m = user\[2\] = 0, must be above 0'):
        load(actuators=f'<plugin name="w" joint="one" plugin="mecanum.wheel" {LAW}/>')


def test_missing_parameters_are_named():
    with pytest.raises(ValueError, match="sample_period_s = dynprm"):
        load(actuators='<plugin joint="one" plugin="mecanum.wheel"/>')


def test_an_actuator_without_a_name_is_told_by_its_number():
    with pytest.raises(ValueError, match='actuator "#1": command_period_s'):
        load(
            actuators=f'<plugin joint="one" plugin="mecanum.wheel" {LAW} {LIMIT}/>'
            '<plugin joint="two" plugin="mecanum.wheel" dynprm="0 0 0 1 0 0 0.01"/>'
        )


def test_one_instance_drives_one_wheel():
    with pytest.raises(ValueError, match="one instance drives one wheel"):
        load(
            instances='<instance name="shared"/>',
            actuators="".join(
                f'<plugin name="{joint}" joint="{joint}" instance="shared" {LAW} {LIMIT}/>'
                for joint in ("one", "two")
            ),
        )


EDITS = [
    *(("actuator_dynprm", DYNPRM.index(name), value) for name, value, _ in BAD_DYNPRM),
    *(("actuator_user", USER.index(name), value) for name, value in BAD_USER),
    *(("actuator_biasprm", SERVO, value) for value in BAD_SERVO),
]


@pytest.mark.parametrize(("field", "index", "value"), EDITS)
def test_edits_are_refused_when_data_is_made(mjmodel, field, index, value):
    getattr(mjmodel, field)[0, index] = value
    with pytest.raises(InputError, match=r'mecanum\.wheel, actuator "wheel_0": '):
        require_valid(mjmodel)
    with pytest.raises(mujoco.FatalError, match="plugin->init failed"):
        mujoco.MjData(mjmodel)


@pytest.mark.parametrize(("field", "index", "value"), EDITS)
def test_edits_of_a_running_model_do_not_crash(mjmodel, field, index, value):
    data = mujoco.MjData(mjmodel)
    data.ctrl[0] = 50.0
    mujoco.mj_step(mjmodel, data, 100)
    good = getattr(mjmodel, field)[0, index]
    getattr(mjmodel, field)[0, index] = value
    mujoco.mj_step(mjmodel, data, 20)
    getattr(mjmodel, field)[0, index] = good
    mujoco.mj_resetData(mjmodel, data)
    data.ctrl[0] = 50.0
    mujoco.mj_step(mjmodel, data, 960)
    assert drive_state(mjmodel, data)["w0"][0] == pytest.approx(50.0, abs=1e-6)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e18, -7.5])
def test_a_state_full_of_nonsense_does_not_crash(mjmodel, value):
    data = mujoco.MjData(mjmodel)
    for index in [None, *range(data.plugin_state.size)]:
        mujoco.mj_resetData(mjmodel, data)
        mujoco.mj_step(mjmodel, data, 10)
        data.plugin_state[slice(None) if index is None else index] = value
        mujoco.mj_step(mjmodel, data, 3)
    mujoco.mj_resetData(mjmodel, data)
    mujoco.mj_step(mjmodel, data, 10)
    assert np.isfinite(data.qvel).all()


def test_a_new_timestep_starts_the_clocks_anew_and_keeps_the_speed(mjmodel):
    data = mujoco.MjData(mjmodel)
    data.ctrl[0] = 50.0
    mujoco.mj_step(mjmodel, data, 960)
    mjmodel.opt.timestep = 1 / 240
    mujoco.mj_step(mjmodel, data, 12)
    state = drive_state(mjmodel, data)
    assert (state["substeps"][0], state["ticks"][0], state["latches"][0]) == (12, 6, 1)
    assert state["w0"][0] == pytest.approx(50.0, abs=1e-6)


def test_rewritten_parameters_are_checked(mjmodel, free_model, paper):
    unstable = type(paper.wheel.law)(1.5, 0.0, 0.0, 0.1, 0.0, 0.0, 1 / 120)
    with pytest.raises(UnstableLawError):
        write_parameters(mjmodel, 0, free_model(law=unstable))
    with pytest.raises(InputError, match="delay_s"):
        write_parameters(mjmodel, 0, free_model(delay_s=30.0))
    with pytest.raises(InputError, match="actuator 1 is not"):
        write_parameters(mjmodel, 1, free_model())
    require_valid(mjmodel)
