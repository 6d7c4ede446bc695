"""Parameters and state of the plugin "mecanum.wheel": where they are, how to write and read them.

parameters.h lists the same parameters. They are numeric fields of the wheel's actuator, so copies,
pickles and batches of models carry them, and a compiled model can be edited (`write_parameters`):

    dynprm      the wheel law, its clocks, quantum and ceiling: `mecanum_env.wheel_drive.parameters.DYNPRM`
    biasprm     0, 0, -servo_n_m_s_rad
    user        everything else: `mecanum_env.wheel_drive.parameters.USER`; from FIRST_PROGRAM on the programs
                of custom effects, if there are any

From "deadband_rpm" on 0 means "off" (a gain of 1, no limit), and a model may have fewer entries. The inertia
is fed forward: with that of the free wheel, the wheel turns as the law says; with 0, the servo's lag,
inertia / servo, comes on top.

The torque limit is not MuJoCo's `forcerange`, which is refused: clamping there drops the servo's implicit
damping, and a free or slipping wheel rings (see chain.c).

The parameters are checked when a model is compiled and when an `mujoco.MjData` is made (`require_valid` says
what is wrong). An edit acts from the next substep on. If it changes the timestep or a period, the clocks
start anew at that substep; speeds and the last command are kept.

A program that knows the supply's voltage writes how far it is below that at the start into
`MjData.userdata[LOST_VOLTAGE]` before each step; all drives of a model share it.

The state is part of MuJoCo's (`MjData.plugin_state`): `mujoco.mj_resetData` and keyframes put every drive at
rest, and `mjSTATE_FULLPHYSICS` saves and restores it.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt

from mecanum_env.effects.apply import changed_model, drive_parameters
from mecanum_env.errors import InputError
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.model import Model, Robot
from mecanum_env.plugin import PLUGIN_NAME, register_if_mujoco_did_not
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from mecanum_env.wheel_drive.drive import LIMITS, RING, DriveParameters
from mecanum_env.wheel_drive.parameters import PROGRAMS, USER
from mecanum_env.wheel_drive.program import PROGRAM_SIZE
from mecanum_env.wheel_drive.set_point import map_numbers
from mecanum_env.wheel_drive.wheel_load import GAP_KINDS

# Whoever compiles a model imports this module first.
register_if_mujoco_did_not()

SERVO: Final = 2
"""Index in biasprm of minus servo_n_m_s_rad."""
_INERTIA: Final = USER.index("inertia_kg_m2")
_ROTOR: Final = USER.index("rotor_kg_m2")
_GAP, _GAP_SWING = (USER.index(name) for name in ("gap_rad", "gap_swing_rad_s"))
_LINK_SEED: Final = USER.index("link_seed")
NO_TORQUE_LIMIT: Final[float] = mujoco.mjMAXVAL
"""The torque limit in user if there is none; not 0, so that a file which omits the limit is refused."""
USER_SIZE: Final = 128
"""`nuser_actuator` as this project writes it without programs; the plugin needs at least 3, and unused
entries are 0."""
LOST_VOLTAGE: Final = 0
"""Index in `MjData.userdata` of the voltage [V] that the supply has lost; a model may lack it."""
_UNUSED: Final = [0.0] * (USER_SIZE - len(USER))
FIRST_PROGRAM: Final = USER_SIZE
"""Index in user of the first program."""

STATE: Final = (
    *("substeps", "ticks", "latches"),
    *("timestep", "sample_period", "command_period"),
    *("w0", "w1", "w2", "r1", "r2", "ramp", "setpoint", "rise", "integral", "change", "gap", "load"),
    *("angle", "slope", "sent", "excess"),
)
"""Names of the first entries of a wheel's plugin state, all zero at rest:

- substeps, ticks, latches: counts since the clocks started
- timestep, sample_period, command_period: the clocks in use [s]
- w0, w1, w2, r1, r2: the law's memory [rpm], w0 = w(k+1), w1 = w(k), between which the setpoint moves
- ramp: command behind the acceleration limit at the end of the tick [rpm]
- setpoint, rise: setpoint at the end of the last substep, and its change in that substep [rad/s]
- integral: integral of the motor's speed error [rad]
- change: the wheel's change of speed in the last substep [rad/s]; the torque limit predicts the next from it
- gap: position of the motor relative to the wheel inside the backlash, from the middle of the gap [rad]
- load: smoothed torque of everything but the drive on the wheel [N m], for its friction
- angle: angle that the wheel has turned through since the start [rad]
- slope: rate of change of an S-curve at the end of the tick [rpm/s]
- sent: the last latched command that was not lost [rpm], rounded but not shaped
- excess: by how much the law's last step was beyond the motor's bounds [rpm]

RING latched commands [rpm] follow, command j at j modulo RING, and the times [s] at which they arrive, which
only count if the delay jitters.
"""
COMMANDS: Final = slice(len(STATE), len(STATE) + RING)
ARRIVALS: Final = slice(COMMANDS.stop, COMMANDS.stop + RING)
STATE_SIZE: Final = ARRIVALS.stop


def dynprm(drive: DriveParameters, quantum_rpm: float | None = None) -> list[float]:
    """Return the ten numbers of an actuator's dynprm.

    The quantum [rpm] replaces the drive's own; 0 if commands are rounded elsewhere.
    """
    return [
        *(getattr(drive.law, name) for name in COEFFICIENTS),
        drive.law.sample_period_s,
        drive.command_period_s,
        drive.command_quantum_rpm if quantum_rpm is None else quantum_rpm,
        _off(drive.saturation_rpm, math.inf),
    ]


def userdata(robot: Robot, drive: DriveParameters, torque_limit_n_m: float | None = None) -> list[float]:
    """Return the numbers of an actuator's user field: USER_SIZE of them, more if there are programs.

    The torque limit replaces the robot's; infinite or NO_TORQUE_LIMIT for none.

    Raises:
        InputError: the limit is not above 0.
    """
    limit = robot.torque_limit_n_m if torque_limit_n_m is None else torque_limit_n_m
    if not np.all(limit > 0.0):
        raise InputError(f"torque_limit_n_m = {limit}, must be above 0 ({NO_TORQUE_LIMIT:g}: no limit)")
    values = {**vars(drive), **vars(drive.load)}
    values["gap_kind"] = float(GAP_KINDS.index(drive.load.gap_kind))
    values |= {name: _off(values[name], 1.0) for name in ("gain", "reverse_ratio")}
    values |= {name: _off(values[name], math.inf) for name in LIMITS}
    values["supply_share"] = drive.supply_share
    values["rotor_kg_m2"] = rotor_inertia(robot, drive)
    if drive.knots_rpm:
        values |= map_numbers(drive.knots_rpm, drive.values_rpm)
    values |= {"servo_integral_n_m_rad": robot.servo_integral_n_m_rad, "servo_windup": robot.servo_windup}
    values["torque_limit_n_m"] = np.minimum(limit, NO_TORQUE_LIMIT)
    numbers = [values.get(name, 0.0) for name in USER] + _UNUSED
    programs = [getattr(drive, name) for name in PROGRAMS]
    if not any(any(program) for program in programs):
        return numbers
    padded = ((*program, *[0.0] * (PROGRAM_SIZE - len(program))) for program in programs)
    return numbers + [number for program in padded for number in program]


def _off(number: Any, neutral: float) -> Any:
    """Return a number, or 0 where it has its `neutral` value; it may be an array of those of many drives."""
    if isinstance(number, np.ndarray):
        return np.where(number == neutral, 0.0, number)
    return 0.0 if number == neutral else number


def rotor_inertia(robot: Robot, drive: DriveParameters) -> float:
    """Return the inertia [kg m^2] that makes a drive answer a load as late as it does."""
    return robot.servo_n_m_s_rad * drive.load.answer_s


class WheelNumbers(NamedTuple):
    """What an actuator of a model is told of its wheel's drive."""

    dynprm: list[float]
    servo_n_m_s_rad: float
    user: list[float]

    @property
    def rotor_kg_m2(self) -> float:
        """The inertia of its rotor, which the joint must have as armature."""
        return self.user[_ROTOR]

    @property
    def chain(self) -> list[Any]:
        """All of them but programs, in the order of `wheel_drive.parameters.CHAIN`."""
        return [*self.dynprm, self.servo_n_m_s_rad, *self.user[: len(USER)]]

    def write(self, mjmodel: mujoco.MjModel, actuators: int | list[int]) -> None:
        """Write them for some actuators, by id, of a compiled model whose user field is large enough."""
        mjmodel.actuator_dynprm[actuators] = self.dynprm
        mjmodel.actuator_biasprm[actuators, SERVO] = -self.servo_n_m_s_rad
        # Most have no program, and numpy takes long to read a list of zeros.
        given = self.user if len(self.user) > USER_SIZE else self.user[: len(USER)]
        user = np.zeros(mjmodel.nuser_actuator)
        user[: len(given)] = given
        mjmodel.actuator_user[actuators] = user


def wheel_numbers(
    model: Model,
    wheel_name: str | None = None,
    quantum_rpm: float | None = None,
    torque_limit_n_m: float | None = None,
    inertia_kg_m2: float = 0.0,
) -> WheelNumbers:
    """Return the numbers of a wheel's drive in a model.

    `wheel_name`, `quantum_rpm`, `torque_limit_n_m` and `inertia_kg_m2` are as for `set_wheel_parameters`.
    """
    drive = drive_parameters(model, wheel_name)
    return drive_numbers(model.robot, drive, quantum_rpm, torque_limit_n_m, inertia_kg_m2)


def drive_numbers(
    robot: Robot,
    drive: DriveParameters,
    quantum_rpm: float | None = None,
    torque_limit_n_m: float | None = None,
    inertia_kg_m2: float = 0.0,
) -> WheelNumbers:
    """Return what `wheel_numbers` does, of the `drive` of a wheel of a `robot`.

    Numbers of both may be arrays (m,), those of many robots; then those that follow from them are arrays.
    """
    user = userdata(robot, drive, torque_limit_n_m)
    user[_INERTIA] = inertia_kg_m2 + user[_ROTOR]
    return WheelNumbers(dynprm(drive, quantum_rpm), robot.servo_n_m_s_rad, user)


def chain_parameters(
    model: Model,
    wheel_name: str | None = None,
    torque_limit_n_m: float | None = None,
    inertia_kg_m2: float = 0.0,
) -> FloatArray:
    """Return a wheel's drive with its programs, (P,), in the order of `wheel_drive.parameters.CHAIN`.

    `model`, `wheel_name`, `torque_limit_n_m` and `inertia_kg_m2` are as for `set_wheel_parameters`.
    """
    return chain_numbers(model.robot, drive_parameters(model, wheel_name), torque_limit_n_m, inertia_kg_m2)


def chain_numbers(
    robot: Robot, drive: DriveParameters, torque_limit_n_m: float | None = None, inertia_kg_m2: float = 0.0
) -> FloatArray:
    """Return what `chain_parameters` does, of the `drive` of a wheel of a `robot`."""
    numbers = drive_numbers(robot, drive, None, torque_limit_n_m, inertia_kg_m2)
    programs = numbers.user[FIRST_PROGRAM:] or np.zeros(len(PROGRAMS) * PROGRAM_SIZE)
    return np.concatenate([numbers.chain, programs])


def set_wheel_parameters(
    spec: mujoco.MjSpec,
    actuator: mujoco.MjsActuator,
    model: Model,
    wheel_name: str | None = None,
    quantum_rpm: float | None = None,
    torque_limit_n_m: float | None = None,
    inertia_kg_m2: float = 0.0,
) -> None:
    """Make a named actuator of a spec a wheel drive with its own plugin instance; call it once per actuator.

    The transmission is kept and a `forcerange` removed. Written XML carries no bias of a plugin actuator, so
    a spec that is to be written needs `biastype` and `biasprm` in its default class, too.

    `wheel_name` is fl, fr, rl or rr for that wheel's own law and effects, `quantum_rpm` as for `dynprm`,
    `torque_limit_n_m` as for `userdata` (the bench has NO_TORQUE_LIMIT), and `inertia_kg_m2` the free
    wheel's. A rotor (`rotor_inertia`) comes on top; the joint must have it as its armature.
    """
    numbers = wheel_numbers(model, wheel_name, quantum_rpm, torque_limit_n_m, inertia_kg_m2)
    spec.activate_plugin(PLUGIN_NAME)
    # MjSpec finds a plugin instance by its name only.
    actuator.plugin = spec.add_plugin(name=actuator.name, plugin_name=PLUGIN_NAME, active=True)
    actuator.dynprm = numbers.dynprm
    actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    actuator.biasprm = [0.0, 0.0, -numbers.servo_n_m_s_rad] + [0.0] * 7
    spec.nuser_actuator = max(spec.nuser_actuator, len(numbers.user))
    spec.nuserdata = max(spec.nuserdata, LOST_VOLTAGE + 1)
    actuator.userdata = numbers.user
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

    The inertia is kept: it belongs to the body, which is not rewritten. So is the seed of the link, which no
    model states (`seed_links`). `actuator_id` is one of `wheel_actuators`; `model`, `wheel_name`,
    `quantum_rpm` and `torque_limit_n_m` are as for `set_wheel_parameters`.

    Raises:
        InputError: that actuator is not a wheel drive, the model's delay is too long, the limit is not
            above 0, or the drive's rotor differs from the compiled one.
        UnstableLawError: the wheel's law is unstable.
    """
    _require_wheel_drive(mjmodel, actuator_id)
    # An effect may change the servo.
    robot, parameters = changed_model(model, "rollers").robot, drive_parameters(model, wheel_name)
    parameters.law.require_stable()
    user = userdata(robot, parameters, torque_limit_n_m)
    if any(user[mjmodel.nuser_actuator :]):
        raise InputError(
            f"nuser_actuator = {mjmodel.nuser_actuator}, must be {len(user)} for a model with these effects"
        )
    given = mjmodel.actuator_user[actuator_id]
    if user[_ROTOR] != (float(given[_ROTOR]) if len(given) > _ROTOR else 0.0):
        raise InputError(
            f"answer_s of the drive's load asks for a rotor of {user[_ROTOR]:g} kg m^2, which is part of the "
            "compiled joint; compile the model anew"
        )
    for kept in (_INERTIA, _LINK_SEED):
        if mjmodel.nuser_actuator > kept:
            user[kept] = given[kept]
    numbers = WheelNumbers(
        dynprm(parameters, quantum_rpm), robot.servo_n_m_s_rad, user[: mjmodel.nuser_actuator]
    )
    numbers.write(mjmodel, actuator_id)


def seed_links(mjmodel: mujoco.MjModel, seed: int) -> None:
    """Give the link of all drives in a compiled model one seed, from 0 to `wheel_drive.link.MOST_SEEDS`.

    The jitter of its delay and the loss of its commands follow from it.
    """
    mjmodel.actuator_user[wheel_actuators(mjmodel), _LINK_SEED] = seed


def require_valid(mjmodel: mujoco.MjModel) -> None:
    """Check the parameters in a compiled model whose fields were edited.

    Compiling and making an `mujoco.MjData` check them, too; the latter says what is wrong on stderr only.

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
    # Python cannot look up a plugin's name in a compiled model, so the size of the state identifies it.
    instances = np.flatnonzero(np.asarray(mjmodel.plugin_statenum) == STATE_SIZE)
    return [int(i) for i in np.flatnonzero(np.isin(mjmodel.actuator_plugin, instances))]


def _require_wheel_drive(mjmodel: mujoco.MjModel, actuator_id: int) -> None:
    known = wheel_actuators(mjmodel)
    if actuator_id not in known:
        raise InputError(f"actuator {actuator_id} is not a {PLUGIN_NAME}; these are: {known}")


def state_slice(mjmodel: mujoco.MjModel, actuator_id: int) -> slice:
    """Return where `MjData.plugin_state` holds the state of the wheel drive `actuator_id`, ordered as STATE.

    Raises:
        InputError: that actuator is not a wheel drive.
    """
    _require_wheel_drive(mjmodel, actuator_id)
    start = int(mjmodel.plugin_stateadr[int(mjmodel.actuator_plugin[actuator_id])])
    return slice(start, start + STATE_SIZE)


def set_steady(
    mjmodel: mujoco.MjModel, data: mujoco.MjData, speeds_rpm: npt.ArrayLike, gap_share: float = 0.0
) -> None:
    """Put every wheel drive in steady motion, as after a long time at a constant command.

    The clocks start anew, so the next substep latches a command and ticks the law, and the servo's integral
    is 0. Joint speeds are not touched; set `data.qvel` to match.

    Speeds are one number [rpm] for all wheel drives, or one for each in the order of the actuators. The
    motor of a wheel at rest stands in its backlash at `gap_share`, from -1 to 1.

    Raises:
        InputError: the number of speeds does not fit, or a speed is not finite.
    """
    actuators = wheel_actuators(mjmodel)
    speeds = np.asarray(speeds_rpm, float)
    if speeds.shape not in ((), (len(actuators),)):
        raise InputError(f"speeds of shape {speeds.shape}, must be one or {len(actuators)} numbers")
    if not np.all(np.isfinite(speeds)):
        raise InputError(f"speeds {speeds.tolist()} rpm, must be finite numbers")
    for actuator, speed in zip(actuators, np.broadcast_to(speeds, (len(actuators),)), strict=True):
        state = data.plugin_state[state_slice(mjmodel, actuator)]
        state[:] = 0.0
        for name in ("w0", "w1", "w2", "r1", "r2", "ramp", "sent"):
            state[STATE.index(name)] = speed
        state[STATE.index("setpoint")] = speed * RAD_S_PER_RPM
        state[COMMANDS] = speed
        if mjmodel.nuser_actuator > _GAP:
            # The motor of a turning wheel has crossed the backlash; an elastic filling rests in its middle.
            user = mjmodel.actuator_user[actuator]
            elastic = mjmodel.nuser_actuator > _GAP_SWING and user[_GAP_SWING] > 0.0
            place = np.sign(speed) or gap_share
            state[STATE.index("gap")] = 0.0 if elastic else place * user[_GAP] / 2


def drive_state(mjmodel: mujoco.MjModel, data: mujoco.MjData) -> dict[str, FloatArray]:
    """Return the state of all wheel drives: name of an entry, as in `STATE` -> values, shape (n_wheels,)."""
    starts = [state_slice(mjmodel, actuator).start for actuator in wheel_actuators(mjmodel)]
    return {name: data.plugin_state[np.array(starts) + i] for i, name in enumerate(STATE)}
