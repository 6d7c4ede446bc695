"""The parameters of a wheel's drive, and what it makes of a single command before the wheel law.

`mecanum_env.wheel_drive.inputs` puts commands on the clock of the law.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.link import MOST_SEEDS, SPREAD, Link
from mecanum_env.wheel_drive.motor_bounds import MotorBounds, steepest_share
from mecanum_env.wheel_drive.program import Program, inputs_of, require_runs
from mecanum_env.wheel_drive.ramp import RampLimits
from mecanum_env.wheel_drive.set_point import map_numbers, require_map
from mecanum_env.wheel_drive.shaping import shaped
from mecanum_env.wheel_drive.wheel_load import NO_LOAD, WheelLoad

EPS: Final = 1e-9
"""Share of its period by which a clock may be early; it absorbs the rounding of n h."""
RING: Final = 64
"""Number of latched commands that a drive remembers; it bounds the delay, see `longest_delay_s`."""


_POSITIVE: Final = ("command_period_s", "gain", "reverse_ratio")
_NOT_NEGATIVE: Final = (
    *("command_quantum_rpm", "deadband_rpm", "subtracted_rpm", "drop_per_s", "warm_up_s", "softness_rpm"),
    *("brake_rpm_s", "drive_brake_rpm_s", "supply_s", "gain_per_volt", "supply_per_volt"),
)
LIMITS: Final = (
    *("saturation_rpm", "acceleration_rpm_s", "jerk_rpm_s2", "drive_acceleration_rpm_s", "supply_rpm"),
)
"""Numbers of a drive that are infinite where there is no such limit."""


def longest_delay_s(command_period_s: float, timestep_s: float = 0.0) -> float:
    """Return the longest delay of a command [s] that a drive can represent, given the robot's command period.

    `timestep_s` is that of the physics that runs the plugin [s]; 0 without one.
    """
    return (RING - 3) * command_period_s - timestep_s


@dataclass(frozen=True)
class DriveParameters:
    """The law, and what the drive does to a command before and after it.

    Raises:
        InputError: a value out of range, or a delay of more than RING - 3 command periods.
    """

    law: WheelLaw
    command_period_s: float
    """Period at which the robot latches its command [s]."""
    command_quantum_rpm: float = 0.0
    """Commands are rounded to multiples of this [rpm], halves to even; 0: not rounded."""
    saturation_rpm: float = math.inf
    """Commands are clipped to +- this [rpm]."""
    delay_s: float = 0.0
    """Time from the latch to the effect of a command [s]."""
    jitter_s: float = 0.0
    """Standard deviation of that time from one change of the command to the next [s]; see `Link`."""
    loss: float = 0.0
    """Probability that a latched command is lost and the one before it goes on."""
    link_seed: int = 0
    """Seed of jitter and losses."""
    deadband_rpm: float = 0.0
    """Commands smaller than this count as 0 [rpm]."""
    subtracted_rpm: float = 0.0
    """Commands lose this much of their size, and smaller ones all of it [rpm]."""
    gain: float = 1.0
    """Factor on every command."""
    reverse_ratio: float = 1.0
    """Further factor on negative commands."""
    drop_per_s: float = 0.0
    """Share of the gain that is lost in each second [1/s]."""
    gain_per_volt: float = 0.0
    """Share of the gain that is lost with each volt of the supply below that at the start [1/V]."""
    warm_up_share: float = 0.0
    """Share of the gain that is lost as the drive warms up, above -1 and below 1; below 0 it rises."""
    warm_up_s: float = 0.0
    """Time constant of the warming [s]; 0: it does not act."""
    knots_rpm: tuple[float, ...] = ()
    """Commands at which a static map is given [rpm]; see `mecanum_env.wheel_drive.set_point.mapped`."""
    values_rpm: tuple[float, ...] = ()
    """What the map makes of them [rpm]."""
    softness_rpm: float = 0.0
    """The saturation begins this far below its limit [rpm]; see `wheel_drive.set_point.saturated`."""
    acceleration_rpm_s: float = math.inf
    """Largest rate of change of the law's input [rpm/s]."""
    brake_rpm_s: float = 0.0
    """The same while it falls in size [rpm/s]; 0: as otherwise."""
    jerk_rpm_s2: float = math.inf
    """Largest change of that rate [rpm/s2]."""
    drive_acceleration_rpm_s: float = math.inf
    """Largest acceleration of the wheel itself by its motor [rpm/s]."""
    drive_brake_rpm_s: float = 0.0
    """Largest deceleration of the wheel itself by its motor [rpm/s]; 0: as its acceleration."""
    supply_rpm: float = math.inf
    """Speed at which the supply leaves the motor no torque [rpm]."""
    supply_s: float = 0.0
    """Time constant of the motor with its wheel at full voltage [s]; 0: the law's fastest tick."""
    supply_per_volt: float = 0.0
    """Share of that speed that is lost with each volt of the supply below that at the start [1/V]."""
    windup: float = 0.0
    """Share of what the law asks beyond these bounds that it asks for again in its next tick, 0 to 1."""
    load: WheelLoad = NO_LOAD
    """What acts behind the setpoint; see `mecanum_env.wheel_drive.servo`."""
    command_program: Program = ()
    """What a custom effect adds to each command before the dead band [rpm]; see `wheel_drive.program`."""
    set_point_program: Program = ()
    """What a custom effect adds behind the gains and before the saturation [rpm]."""
    load_program: Program = ()
    """Speed that the wheel gains by a custom load, which is a torque of servo times this speed [rpm]."""

    def __post_init__(self) -> None:
        for name in _POSITIVE:
            if not 0.0 < getattr(self, name) < math.inf:
                raise InputError(f"{name} = {getattr(self, name)}, must be a finite number above 0")
        for name in _NOT_NEGATIVE:
            if not 0.0 <= getattr(self, name) < math.inf:
                raise InputError(f"{name} = {getattr(self, name)}, must be finite and not below 0")
        for name in LIMITS:
            if not getattr(self, name) > 0.0:
                raise InputError(f"{name} = {getattr(self, name)}, must be above 0 (infinite: no limit)")
        if not abs(self.warm_up_share) < 1.0:
            raise InputError(f"warm_up_share = {self.warm_up_share}, must lie between -1 and 1")
        if self.knots_rpm or self.values_rpm:
            require_map(self.knots_rpm, self.values_rpm)
        for program in (self.command_program, self.set_point_program, self.load_program):
            if program:
                require_runs(program)
        longest = longest_delay_s(self.command_period_s)
        if not 0.0 <= self.delay_s <= longest:
            raise InputError(
                f"delay_s = {self.delay_s}, must be 0 to {longest:g} ({RING - 3} command periods)"
            )
        if not (self.jitter_s >= 0.0 and self.delay_s + SPREAD * self.jitter_s <= longest):
            raise InputError(
                f"jitter_s = {self.jitter_s}, must not be below 0, and delay_s + {SPREAD:.3g} jitter_s "
                f"at most {longest:g} ({RING - 3} command periods)"
            )
        for name in ("loss", "windup"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InputError(f"{name} = {getattr(self, name)}, must be from 0 to 1")
        if not 0 <= self.link_seed <= MOST_SEEDS:
            raise InputError(f"link_seed = {self.link_seed}, must be a whole number from 0 to 2^53")

    @property
    def motor_bounds(self) -> MotorBounds:
        """What the motor's torque and its supply leave of the law's steps."""
        tick = self.law.sample_period_s
        return MotorBounds(
            self.drive_acceleration_rpm_s * tick,
            (self.drive_brake_rpm_s or self.drive_acceleration_rpm_s) * tick,
            self.supply_rpm,
            self.supply_share,
            self.supply_per_volt,
            self.windup,
        )

    @property
    def supply_share(self) -> float:
        """Share of what is left to the supply's speed that a wheel gains in a tick; 0 without a supply.

        Several drives as one (`wheel_drive.many`) must all have a supply and a time constant.
        """
        if np.all(np.isfinite(self.supply_rpm)) and np.all(np.greater(self.supply_s, 0.0)):
            share: float = -np.expm1(-self.law.sample_period_s / self.supply_s)
            return share
        # Arrays, of which some are in another case, raise a TypeError here.
        if math.isinf(self.supply_rpm) or math.isinf(self.supply_s):
            return 0.0
        return steepest_share(self.law)

    @property
    def reads_voltage(self) -> bool:
        """Whether the wheel depends on the supply's voltage."""
        programs = (self.command_program, self.set_point_program, self.load_program)
        limited = self.supply_per_volt > 0.0 and math.isfinite(self.supply_rpm)
        return self.gain_per_volt > 0.0 or limited or any("voltage" in inputs_of(p) for p in programs)

    @property
    def warms_up(self) -> bool:
        """Whether the gain changes as the drive warms up."""
        return self.warm_up_share != 0.0 and self.warm_up_s > 0.0

    @property
    def link(self) -> Link:
        """How its commands come to the drive."""
        return Link(self.command_period_s, self.delay_s, self.jitter_s, self.loss, self.link_seed)

    @property
    def ramp_limits(self) -> RampLimits:
        """What bounds the change of the law's input."""
        rise = self.acceleration_rpm_s
        limits = rise, self.brake_rpm_s or rise, self.jerk_rpm_s2, self.law.sample_period_s
        return RampLimits(*map(np.asarray, limits))


def shaped_command(
    parameters: DriveParameters,
    command_rpm: npt.ArrayLike,
    seconds: npt.ArrayLike,
    speed_rpm: npt.ArrayLike = 0.0,
    angle_rad: npt.ArrayLike = 0.0,
    lost_v: npt.ArrayLike = 0.0,
) -> FloatArray:
    """Return rounded commands after dead band, gains, static map and saturation [rpm].

    `seconds` is the time since the start at which each takes effect [s]; `speed_rpm` and `angle_rad` are
    those of the wheel at the latch, which custom effects may use, and `lost_v` is the voltage that the supply
    has lost by then [V]. They are of shapes that broadcast.
    """
    numbers = {**vars(parameters), **map_numbers(parameters.knots_rpm, parameters.values_rpm)}
    return shaped(numbers, command_rpm, seconds, speed_rpm, angle_rad, lost_v)


def require_open_loop(parameters: DriveParameters) -> None:
    """Refuse a drive whose set-points the commands alone do not give.

    Raises:
        InputError: a custom effect changes the command by the wheel's speed or angle.
    """
    used = inputs_of(parameters.command_program) | inputs_of(parameters.set_point_program)
    if used & {"speed", "angle"}:
        raise InputError(
            "a custom effect of the command or the set-point uses the wheel's speed or angle: the commands "
            "alone do not give the set-points, simulate the wheel (mecanum_env.simulator)"
        )
