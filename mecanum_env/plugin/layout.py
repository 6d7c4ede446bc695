"""Where the plugin "mecanum.wheel" keeps its parameters and its state; mecanum_wheel.c reads the same places.

Parameters are numeric fields of the wheel's actuator, so they travel with copies, pickles and batches of
models, and may be rewritten in a compiled model (`write_parameters`):

    dynprm[0:6]   A..F             dynprm[6]  sample_period_s       dynprm[8]  command_quantum_rpm (0: none)
    biasprm       0, 0, -servo     dynprm[7]  command_period_s      dynprm[9]  saturation_rpm (0: none)
    user[0]       servo_integral   user[1]    delay_s               user[2]    torque_limit_n_m (1e10: none)
    user[3]       deadband_rpm     user[4]    gain                  user[5]    reverse_ratio
    user[6]       drop_per_s       user[7]    softness_rpm          user[8]    acceleration_rpm_s
    user[9]       gap_rad          user[10]   breakaway_n_m         user[11]   stribeck_rad_s
    user[12]      coulomb_n_m      user[13]   inertia_kg_m2 (the wheel's own)

From user[3] on 0 means "off" (a gain of 1, no limit), and a model may have fewer. The inertia is fed forward:
with that of the free wheel, it turns as the law says; with 0 the servo's lag, inertia / servo, comes on top.

The torque limit is not MuJoCo's `forcerange`, which is refused: clamping there drops the servo's implicit
damping, and a free or slipping wheel rings (mecanum_wheel.c says why, and how the plugin limits instead).

They are checked on compiling and on making an `mujoco.MjData` (`require_valid` says what is wrong). An edit
acts from the next substep on; where it changes the timestep or a period, the clocks start anew at that
substep, with speeds and the last command kept.
"""

from __future__ import annotations

import math
from typing import Final

import mujoco
import numpy as np

from mecanum_env.effects.apply import changed_model, drive_parameters
from mecanum_env.errors import InputError
from mecanum_env.law.drive import RING, DriveParameters
from mecanum_env.model import Model, Robot
from mecanum_env.plugin import PLUGIN_NAME

COEFFICIENTS: Final = slice(0, 6)
"""In dynprm: A..F."""
SAMPLE_PERIOD: Final = 6
COMMAND_PERIOD: Final = 7
QUANTUM: Final = 8
SATURATION: Final = 9
"""In dynprm."""

SERVO: Final = 2
"""In biasprm: minus servo_n_m_s_rad."""

INTEGRAL_GAIN: Final = 0
DELAY: Final = 1
TORQUE_LIMIT: Final = 2
DEADBAND: Final = 3
GAIN: Final = 4
REVERSE_RATIO: Final = 5
DROP: Final = 6
SOFTNESS: Final = 7
ACCELERATION: Final = 8
GAP: Final = 9
BREAKAWAY: Final = 10
STRIBECK: Final = 11
COULOMB: Final = 12
INERTIA: Final = 13
"""In user."""
NO_TORQUE_LIMIT: Final[float] = mujoco.mjMAXVAL
"""In user[TORQUE_LIMIT]: no limit. A number, not 0: a file that forgets the limit is refused."""
USER_SIZE: Final = 16
"""`nuser_actuator` as this project writes it; the plugin needs 3, the rest is reserved and 0."""

STATE: Final = (
    *("substeps", "ticks", "latches"),
    *("timestep", "sample_period", "command_period"),
    *("w0", "w1", "w2", "r1", "r2", "ramp", "setpoint", "rise", "integral", "change", "gap", "load"),
)
"""Names of the first entries of a wheel's plugin state: counts since the clocks started; the clocks in use
[s]; the law's memory [rpm], w0 = w(k+1) and w1 = w(k) being the ends of the setpoint's ramp; the command
behind the acceleration limit at the tick's end [rpm]; the setpoint at the end of the last substep and what it
rose in it [rad/s]; the integral of the motor's speed error [rad]; the wheel's change of speed over the last
substep [rad/s], from which the torque limit guesses the next; how far the motor is ahead of the wheel inside
the backlash [rad], from the gap's middle; the smoothed torque of others on the wheel [N m], for its
friction. RING latched commands [rpm] follow, command j at j modulo RING. All zero is rest."""
COMMANDS: Final = slice(len(STATE), len(STATE) + RING)
STATE_SIZE: Final = len(STATE) + RING


def dynprm(drive: DriveParameters, quantum_rpm: float | None = None) -> list[float]:
    """Return the ten numbers of an actuator's dynprm.

    Args:
        drive: of this wheel.
        quantum_rpm: another command rounding instead of the drive's own; 0 where it happens before.
    """
    return [
        *(float(x) for x in drive.law.coefficients),
        drive.law.sample_period_s,
        drive.command_period_s,
        drive.command_quantum_rpm if quantum_rpm is None else quantum_rpm,
        0.0 if math.isinf(drive.saturation_rpm) else drive.saturation_rpm,
    ]


def userdata(robot: Robot, drive: DriveParameters, torque_limit_n_m: float | None = None) -> list[float]:
    """Return the numbers of an actuator's user field, USER_SIZE of them.

    Args:
        robot: its servo and torque limit.
        drive: of this wheel.
        torque_limit_n_m: another limit instead of the robot's; infinite or NO_TORQUE_LIMIT for none.

    Raises:
        InputError: the limit is not above 0.
    """
    limit = robot.torque_limit_n_m if torque_limit_n_m is None else torque_limit_n_m
    if not limit > 0.0:
        raise InputError(f"torque_limit_n_m = {limit}, must be above 0 ({NO_TORQUE_LIMIT:g}: no limit)")
    user = [0.0] * USER_SIZE
    user[INTEGRAL_GAIN], user[DELAY] = robot.servo_integral_n_m_rad, drive.delay_s
    user[TORQUE_LIMIT] = min(limit, NO_TORQUE_LIMIT)
    user[DEADBAND], user[DROP], user[SOFTNESS] = drive.deadband_rpm, drive.drop_per_s, drive.softness_rpm
    user[GAIN] = 0.0 if drive.gain == 1.0 else drive.gain
    user[REVERSE_RATIO] = 0.0 if drive.reverse_ratio == 1.0 else drive.reverse_ratio
    user[ACCELERATION] = 0.0 if math.isinf(drive.acceleration_rpm_s) else drive.acceleration_rpm_s
    user[GAP], user[BREAKAWAY], user[STRIBECK] = drive.gap_rad, drive.breakaway_n_m, drive.stribeck_rad_s
    user[COULOMB] = drive.coulomb_n_m
    return user


def set_wheel_parameters(
    spec: mujoco.MjSpec,
    actuator: mujoco.MjsActuator,
    model: Model,
    wheel_name: str | None = None,
    quantum_rpm: float | None = None,
    torque_limit_n_m: float | None = None,
    inertia_kg_m2: float = 0.0,
) -> None:
    """Make a named actuator of a spec a wheel drive with a plugin instance of its own; call it once.

    The transmission is left alone; a `forcerange` is removed. Written XML carries no bias of a plugin
    actuator: put `biastype` and `biasprm` into the spec's default class too where it is to be written.

    Args:
        spec: the actuator's spec.
        actuator: with a unique name.
        model: the wheel, servo, torque limit, and the effects that act in the drive.
        wheel_name: fl, fr, rl or rr, for a wheel with a law of its own.
        quantum_rpm: as for `dynprm`.
        torque_limit_n_m: as for `userdata`; the bench has NO_TORQUE_LIMIT.
        inertia_kg_m2: of the free wheel.
    """
    robot, parameters = model.robot, drive_parameters(model, wheel_name)
    spec.activate_plugin(PLUGIN_NAME)
    spec.nuser_actuator = max(spec.nuser_actuator, USER_SIZE)
    # The instance's name is the actuator's: without one MjSpec finds no instance.
    actuator.plugin = spec.add_plugin(name=actuator.name, plugin_name=PLUGIN_NAME, active=True)
    actuator.dynprm = dynprm(parameters, quantum_rpm)
    actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    actuator.biasprm = [0.0, 0.0, -robot.servo_n_m_s_rad] + [0.0] * 7
    user = userdata(robot, parameters, torque_limit_n_m)
    user[INERTIA] = inertia_kg_m2
    actuator.userdata = user
    actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_FALSE
    actuator.forcerange = [0.0, 0.0]


def write_parameters(
    mjmodel: mujoco.MjModel,
    actuator_id: int,
    model: Model,
    wheel_name: str | None = None,
    quantum_rpm: float | None = None,
    torque_limit_n_m: float | None = None,
) -> None:
    """Rewrite the parameters of one wheel drive in a compiled model; they act from the next substep on.

    The inertia stays: it belongs to the body, which is not rewritten.

    Args:
        mjmodel: the compiled model, written in place.
        actuator_id: a wheel drive, one of `wheel_actuators`.
        model: the wheel, servo, torque limit, and the effects that act in the drive.
        wheel_name: fl, fr, rl or rr, for a wheel with a law of its own.
        quantum_rpm: as for `dynprm`.
        torque_limit_n_m: as for `userdata`; the bench has NO_TORQUE_LIMIT.

    Raises:
        InputError: that actuator is not a wheel drive, the model's delay is too long, or the limit is not
            above 0.
        UnstableLawError: the wheel's law is unstable.
    """
    if actuator_id not in wheel_actuators(mjmodel):
        raise InputError(
            f"actuator {actuator_id} is not a {PLUGIN_NAME}; these are: {wheel_actuators(mjmodel)}"
        )
    # The servo may be an effect; what the body is made of is not written here.
    robot, parameters = changed_model(model, "rollers").robot, drive_parameters(model, wheel_name)
    parameters.law.require_stable()
    user = userdata(robot, parameters, torque_limit_n_m)
    if any(user[mjmodel.nuser_actuator :]):
        raise InputError(
            f"nuser_actuator = {mjmodel.nuser_actuator}, must be {USER_SIZE} for a model with these effects"
        )
    if mjmodel.nuser_actuator > INERTIA:
        user[INERTIA] = mjmodel.actuator_user[actuator_id, INERTIA]
    user = user[: mjmodel.nuser_actuator]
    mjmodel.actuator_dynprm[actuator_id] = dynprm(parameters, quantum_rpm)
    mjmodel.actuator_biasprm[actuator_id, SERVO] = -robot.servo_n_m_s_rad
    mjmodel.actuator_user[actuator_id, : len(user)] = user


def require_valid(mjmodel: mujoco.MjModel) -> None:
    """Check the parameters in a compiled model, for one whose fields were edited.

    Compiling and making an `mujoco.MjData` check them too; the latter says only on stderr what was wrong.

    Raises:
        InputError: the plugin refuses them; the message names the actuator, the field and its value.
    """
    warnings: list[str] = []
    previous = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(warnings.append)
    try:
        mujoco.MjData(mjmodel)
    except mujoco.FatalError as error:
        raise InputError("; ".join(warnings) or str(error)) from error
    finally:
        mujoco.set_mju_user_warning(previous)


def wheel_actuators(mjmodel: mujoco.MjModel) -> list[int]:
    """Return the ids of the actuators that are wheel drives, in order."""
    slots = _wheel_instances(mjmodel)
    return [i for i, instance in enumerate(mjmodel.actuator_plugin) if instance in slots]


def state_slice(mjmodel: mujoco.MjModel, actuator_id: int) -> slice:
    """Return where `MjData.plugin_state` holds the state of the wheel drive `actuator_id`, ordered as STATE.

    Raises:
        InputError: that actuator is not a wheel drive.
    """
    _require_wheel_drive(mjmodel, actuator_id)
    instance = int(mjmodel.actuator_plugin[actuator_id])
    start = int(mjmodel.plugin_stateadr[instance])
    return slice(start, start + STATE_SIZE)


def _wheel_instances(mjmodel: mujoco.MjModel) -> set[int]:
    """Instances of this plugin. MuJoCo has no lookup by name from Python; the state's size tells them."""
    return {int(i) for i in np.flatnonzero(np.asarray(mjmodel.plugin_statenum) == STATE_SIZE)}


def _require_wheel_drive(mjmodel: mujoco.MjModel, actuator_id: int) -> None:
    known = wheel_actuators(mjmodel)
    if actuator_id not in known:
        raise InputError(f"actuator {actuator_id} is not a {PLUGIN_NAME}; these are: {known}")
