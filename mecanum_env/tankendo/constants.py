"""Checks of the numbers that a user may put into the task's constants.

Every number of the task, with its source.

What the sport fixes: a sword of 53 cm, a field of 9 x 9 m, four targets, and that at striking distance (maai)
the two tips meet without crossing. Published for kendo: a fast attack takes 0.09 to 0.15 s from the start of
the sword's forward motion, and 0.44 to 0.58 s from the signal that starts it. Everything else is this
project's own choice: no robot paper prints the figures of its opponent. Replace what you know better.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields, replace
from numbers import Real
from typing import TYPE_CHECKING, Any, Final, Literal, get_args

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.units import FloatArray

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


def require_number(
    where: str, value: Any, low: float = -math.inf, high: float = math.inf, *, strict: bool = False
) -> None:
    """Raise `InputError` unless `value` is a finite number from `low` (`strict`: above it) to `high`.

    Args:
        where: its name in the message.
        value: whatever was given.
        low: the least that it may be.
        high: the most that it may be.
        strict: `low` itself is refused.
    """
    sound = isinstance(value, Real) and math.isfinite(value) and low <= float(value) <= high
    if sound and not (strict and value == low):
        return
    if high < math.inf:
        what = f"a number {low:g} .. {high:g}"
    else:
        bound = "" if low == -math.inf else f" above {low:g}" if strict else f", at least {low:g}"
        what = f"a finite number{bound}"
    raise InputError(f"{where} = {value!r}, must be {what}")


def require_numbers(
    constants: DataclassInstance,
    *,
    positive: Collection[str] = (),
    signed: Collection[str] = (),
    shares: Collection[str] = (),
) -> None:
    """Raise `InputError` unless all numbers and ranges of some constants are finite and not below 0.

    Args:
        constants: fields that are neither numbers nor ranges (low, high) are left alone.
        positive: names of fields that must be above 0.
        signed: of fields that may be below 0.
        shares: of fields that may not be above 1.
    """
    for field in fields(constants):
        where, value = f"{type(constants).__name__}.{field.name}", getattr(constants, field.name)
        low = -math.inf if field.name in signed else 0.0
        high = 1.0 if field.name in shares else math.inf
        if field.type in ("float", "int"):
            require_number(where, value, low, high, strict=field.name in positive)
        if field.type == "int" and value != int(value):
            raise InputError(f"{where} = {value!r}, must be a whole number")
        if field.type == "tuple[float, float]":
            _require_range(where, value, low, high)


def _require_range(where: str, value: Any, low: float, high: float) -> None:
    try:
        first, last = value
    except (TypeError, ValueError) as error:
        raise InputError(f"{where} = {value!r}, must be two numbers: low, high") from error
    require_number(f"{where}[0]", first, low, high)
    require_number(f"{where}[1]", last, low, high)
    if first > last:
        raise InputError(f"{where} = {value!r}, must have the lower one first")


Difficulty = Literal["easy", "normal", "hard"]
DIFFICULTIES: Final[tuple[Difficulty, ...]] = get_args(Difficulty)

GUARD_TIP_M = 0.85
"""From the centre of a player to the tip of its sword on guard [m]: 0.32 to the pommel and 0.53 of sword."""


@dataclass(frozen=True)
class Technique:
    """One way to strike; all values but `swing_s` are ours."""

    name: str
    """The target: do (trunk) and nodo (throat) are thrusts, men (head) and kote (forearm) are cuts."""
    swing_s: float
    """From the start of the sword's forward motion to the hit [s]; published for kendo: 0.09 to 0.15."""
    reach_m: float
    """Farthest place of the tip, step included, from where the opponent stood [m]."""
    width_m: float
    """Width across the strike within which the target is hit [m]."""
    depth_m: float
    """A target this far behind the aimed place is still hit [m]."""
    blade_m: float
    """A target this far before the aimed place is still hit [m]: along a thrust all of it, on a cut the part
    of the blade that counts."""
    target_m: float
    """Where the target is on the robot, ahead of its centre [m]."""
    target_height_m: float
    """Height of the target over the floor [m]."""
    raised_tip_m: float
    """From the opponent's centre to its tip when the sword is drawn back [m]."""
    raised_height_m: float
    """Height of the tip when the sword is drawn back [m]."""

    def __post_init__(self) -> None:
        require_numbers(self, signed=("target_m",))


TECHNIQUES: Final = (
    Technique("do", 0.12, 1.86, 0.24, 0.13, 1.0, 0.05, 0.42, 0.62, 0.38),
    Technique("nodo", 0.10, 2.05, 0.14, 0.13, 1.0, 0.05, 0.58, 0.58, 0.66),
    Technique("men", 0.15, 2.05, 0.18, 0.13, 0.35, 0.02, 0.68, 0.45, 1.05),
    Technique("kote", 0.09, 1.78, 0.18, 0.12, 0.35, 0.28, 0.46, 0.70, 0.84),
)


@dataclass(frozen=True)
class Opponent:
    """How the opponent fights; the values are ours, those of level normal."""

    warning_s: tuple[float, float] = (0.44, 0.58)
    """From the first visible motion to the hit [s], drawn evenly; published for kendo: 0.44 to 0.58."""
    sight_delay_s: float = 0.20
    """It knows the robot as it was this long ago [s]."""
    lead: float = 1.0
    """Share of the robot's seen motion, up to the hit, that it adds to its aim."""
    aim_noise_m: float = 0.02
    """Standard deviation of its aim along each axis [m]."""
    extra_reach_m: float = 0.0
    """Added to the reach of every technique [m]."""
    extra_size_m: float = 0.0
    """Added to width and depth of every technique [m]."""
    patience_s: tuple[float, float] = (0.3, 1.2)
    """How long the robot must have been open before it strikes [s], drawn evenly."""
    feint_probability: float = 0.3
    """Of drawing the sword back once and lowering it before the strike."""
    feint_s: tuple[float, float] = (0.16, 0.28)
    """How long the sword rises in a feint [s], drawn evenly."""
    lower_s: float = 0.3
    """How long the sword takes back to guard after a feint [s]."""
    step_m: float = 0.35
    """How far its body goes forward in a strike [m]; it is part of the reach."""
    recovery_s: float = 0.7
    """From the hit until it is on guard where it stood [s]."""
    walk_m_s: float = 0.7
    """Largest walking speed [m/s]."""
    walk_m_s2: float = 3.0
    """Largest change of walking speed [m/s^2]."""
    drift_m_s: float = 0.12
    """Largest sideways walk around the robot [m/s], drawn evenly on either side."""
    turn_rad_s: float = 4.0
    """Largest turning speed [rad/s]."""
    wander_m_s: float = 0.45
    """Root mean square speed of its walk in the tracking task, along and across [m/s]."""
    techniques: tuple[Technique, ...] = TECHNIQUES
    """What it strikes with, each equally often."""

    def __post_init__(self) -> None:
        require_numbers(self, signed=("lead", "extra_reach_m", "extra_size_m"), shares=("feint_probability",))
        if not self.techniques or not all(isinstance(one, Technique) for one in self.techniques):
            raise InputError(f"Opponent.techniques = {self.techniques!r}, must be at least one Technique")


_LEVELS: Final[Mapping[str, Opponent]] = {
    "easy": Opponent(
        warning_s=(0.58, 0.72),
        sight_delay_s=0.25,
        lead=0.9,
        aim_noise_m=0.03,
        extra_reach_m=-0.05,
        feint_probability=0.15,
        wander_m_s=0.3,
    ),
    "normal": Opponent(),
    "hard": Opponent(
        warning_s=(0.38, 0.50),
        sight_delay_s=0.17,
        lead=1.0,
        aim_noise_m=0.015,
        extra_reach_m=0.05,
        extra_size_m=0.01,
        feint_probability=0.45,
        wander_m_s=0.6,
    ),
}


def opponent_for(difficulty: str) -> Opponent:
    """Return the opponent of a difficulty: easy, normal or hard.

    Raises:
        InputError: there is no such difficulty.
    """
    if difficulty not in _LEVELS:
        raise InputError(
            f"difficulty = {difficulty!r}{did_you_mean(difficulty, _LEVELS)}, must be {', '.join(_LEVELS)}"
        )
    return _LEVELS[difficulty]


@dataclass(frozen=True)
class Rules:
    """The two rules that make it a task and not a flight, and what ends an episode; the values are ours."""

    maai_m: float = 2 * GUARD_TIP_M
    """Striking distance between the centres [m]: the tips meet."""
    band_m: float = 0.25
    """How far from maai still counts as at maai [m]."""
    facing_rad: float = 0.35
    """How far the opponent may be off the robot's forward axis for it to count as facing [rad]."""
    slow_m_s: float = 0.25
    """A robot faster than this offers no opening [m/s]."""
    return_s: float = 1.0
    """This long after the strike the robot must be at maai and facing [s]."""
    clash_m: float = 0.65
    """Centres nearer than this are a clash, which ends the episode [m]."""
    field_m: float = 9.0
    """Side of the square field [m]; leaving it ends the episode."""
    start_m: tuple[float, float] = (2.2, 2.8)
    """Distance at the start [m], drawn evenly."""
    start_offset_m: float = 0.5
    """Largest offset of the robot's starting place along each axis [m]."""
    start_yaw_rad: float = 0.3
    """Largest error of the robot's heading at the start [rad]."""
    dodge_time_s: float = 12.0
    """Time limit of the dodge [s]."""
    track_time_s: float = 15.0
    """Length of the tracking task [s]."""
    track_settle_s: float = 3.0
    """Tracking counts from here on [s]."""
    track_share: float = 0.8
    """Share of that time at maai and facing which is a success."""
    duel_time_s: float = 60.0
    """Time limit of the duel [s]."""
    duel_points: int = 2
    """Who has these first wins the duel: best of three."""
    duel_pause_s: float = 1.0
    """No strike for this long after a point [s]."""
    own_reach_m: float = 1.45
    """The robot's sword reaches an opponent whose centre is this near [m]."""
    own_aim_rad: float = 0.15
    """and this little off the robot's forward axis [rad]."""
    own_strike_s: float = 0.2
    """From the start of the robot's strike to its hit [s]."""

    def __post_init__(self) -> None:
        times = ("dodge_time_s", "track_time_s", "duel_time_s")
        positive = ("maai_m", "band_m", "facing_rad", "field_m", "duel_points", *times)
        require_numbers(self, positive=positive, shares=("track_share",))

    def at_maai(self, distance_m: FloatArray, bearing_rad: FloatArray) -> npt.NDArray[np.bool_]:
        """Return whether the robot is at maai and faces the opponent, of the shape of both arguments.

        Args:
            distance_m: distance of the centres.
            bearing_rad: bearing of the opponent from the robot.
        """
        at_maai: npt.NDArray[np.bool_] = (np.abs(distance_m - self.maai_m) <= self.band_m) & (
            np.abs(bearing_rad) <= self.facing_rad
        )
        return at_maai


@dataclass(frozen=True)
class Sensors:
    """What the robot's sensors leave out; the values are ours, of a camera and wheel odometry."""

    delay_s: float = 0.05
    """Everything is seen this late [s]."""
    position_m: float = 0.01
    """Standard deviation of seen positions and heights [m]."""
    velocity_m_s: float = 0.05
    """Of the opponent's seen velocity [m/s]."""
    tip_velocity_m_s: float = 0.1
    """Of the tip's seen velocity [m/s]."""
    own_velocity_m_s: float = 0.02
    """Of the own velocity [m/s]."""
    own_yaw_rate_rad_s: float = 0.02
    """Of the own yaw rate [rad/s]."""
    place_m: float = 0.02
    """Of the own place in the field [m]."""
    heading_rad: float = 0.01
    """Of the own heading [rad]."""

    def __post_init__(self) -> None:
        require_numbers(self)


@dataclass(frozen=True)
class RewardWeights:
    """Weights of the reward's terms; each term is documented with its task."""

    distance: float = 0.02
    """A step, at one band's width from maai; grows with the distance up to three times that."""
    facing: float = 0.01
    """A step, at the largest angle that counts as facing; grows up to three times that."""
    effort: float = 0.005
    """A step, for a change of the command from full one way to standing."""
    waiting: float = 0.02
    """A step before the strike has come; in the duel, every step. Without it a beginner learns never to offer
    an opening, which loses nothing."""
    hit: float = 1.0
    """Being hit."""
    success: float = 1.0
    """Success; in the duel, each point."""
    out: float = 1.0
    """Leaving the field or clashing."""

    def __post_init__(self) -> None:
        require_numbers(self, signed=[field.name for field in fields(self)])

    def replaced(self, values: Mapping[str, float]) -> RewardWeights:
        """Return a copy with some values replaced by name.

        Raises:
            InputError: a name that is no term, or a value that is no number.
        """
        known = [field.name for field in fields(self)]
        for name, value in values.items():
            if name not in known:
                raise InputError(
                    f"reward_weights: no term {name!r}{did_you_mean(name, known)}; known: {', '.join(known)}"
                )
            require_number(f"reward_weights: {name}", value)
        return replace(self, **{name: float(value) for name, value in values.items()})
