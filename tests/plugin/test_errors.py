"""What the plugin refuses, in which words, and that edits of a running model never crash."""

import mujoco
import numpy as np
import pytest

from mecanum_env.errors import InputError, UnstableLawError
from mecanum_env.plugin.layout import (
    ACCELERATION,
    BREAKAWAY,
    COMMAND_PERIOD,
    DEADBAND,
    DELAY,
    DROP,
    GAIN,
    GAP,
    INTEGRAL_GAIN,
    QUANTUM,
    REVERSE_RATIO,
    SAMPLE_PERIOD,
    SATURATION,
    SERVO,
    SOFTNESS,
    STRIBECK,
    TORQUE_LIMIT,
    drive_state,
    require_valid,
    write_parameters,
)

pytestmark = pytest.mark.usefixtures("in_tmp_path")

BAD_DYNPRM = [
    (0, np.nan, "A = dynprm"),
    (5, np.inf, "F = dynprm"),
    (0, 1.5, "unstable"),
    (2, -1.0, "unstable"),
    (SAMPLE_PERIOD, 0.0, "sample_period_s"),
    (SAMPLE_PERIOD, -0.01, "sample_period_s"),
    (SAMPLE_PERIOD, np.nan, "sample_period_s"),
    (SAMPLE_PERIOD, 1e-7, "timestep"),
    (COMMAND_PERIOD, 0.0, "command_period_s"),
    (COMMAND_PERIOD, np.inf, "command_period_s"),
    (COMMAND_PERIOD, 1e-6, "timestep"),
    (QUANTUM, -1.0, "command_quantum_rpm"),
    (QUANTUM, np.nan, "command_quantum_rpm"),
    (SATURATION, -1.0, "saturation_rpm"),
    (SATURATION, np.inf, "saturation_rpm"),
]
BAD_USER = [
    (INTEGRAL_GAIN, -1.0, "servo_integral_n_m_rad"),
    (INTEGRAL_GAIN, np.nan, "servo_integral_n_m_rad"),
    (DELAY, -0.1, "delay_s"),
    (DELAY, 5.0, "delay_s"),
    (DELAY, np.nan, "delay_s"),
    (TORQUE_LIMIT, 0.0, "torque_limit_n_m"),
    (TORQUE_LIMIT, -1.0, "torque_limit_n_m"),
    (TORQUE_LIMIT, np.nan, "torque_limit_n_m"),
    (DEADBAND, -1.0, "command_deadband.threshold_rpm"),
    (GAIN, -0.5, "gain"),
    (REVERSE_RATIO, np.nan, "reverse_ratio"),
    (DROP, np.inf, "battery_sag.drop_per_s"),
    (SOFTNESS, -1.0, "speed_saturation.softness_rpm"),
    (ACCELERATION, -1.0, "acceleration_limit.limit_rpm_s"),
    (GAP, -0.1, "backlash"),
    (BREAKAWAY, -1.0, "stiction.breakaway_n_m"),
    (STRIBECK, np.nan, "stiction.stribeck"),
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


@pytest.mark.parametrize(("index", "value", "word"), BAD_DYNPRM)
def test_bad_parameters_do_not_compile(spec, index, value, word):
    values = np.array(spec.actuators[0].dynprm)
    values[index] = value
    spec.actuators[0].dynprm = values
    refused(spec, word)


@pytest.mark.parametrize(("index", "value", "word"), BAD_USER)
def test_bad_user_values_do_not_compile(spec, index, value, word):
    values = np.array(spec.actuators[0].userdata)
    values[index] = value
    spec.actuators[0].userdata = values
    refused(spec, word)


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
    *(("actuator_dynprm", index, value) for index, value, _ in BAD_DYNPRM),
    *(("actuator_user", index, value) for index, value, _ in BAD_USER),
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
