"""The constants of the task, each with its unit and source, and the checks of values that a user gives.

Fixed by the sport: a sword of 53 cm, a field of 9 x 9 m, four targets, and a striking distance (maai) at
which the two tips meet without crossing. Published for kendo: a fast attack takes 0.09 to 0.15 s from the
start of the sword's forward motion, and 0.44 to 0.58 s from the signal that starts it. All other values are
this project's own choice, since no robot paper states those of its opponent; replace those you know better.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields, replace
from numbers import Real
from typing import TYPE_CHECKING, Any, Final, Literal, get_args

from mecanum_env.errors import InputError, did_you_mean, require_one_of
from mecanum_env.tankendo.numbers import Number

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Difficulty = Literal["easy", "normal", "hard"]
DIFFICULTIES: Final[tuple[Difficulty, ...]] = get_args(Difficulty)
LeadForm = Literal["none", "constant_velocity", "adaptive"]
LEAD_FORMS: Final[tuple[LeadForm, ...]] = get_args(LeadForm)
"""How an opponent leads its aim; see `Opponent.lead_form`."""

GUARD_TIP_M = 0.85
"""Distance from a player's centre to the tip of its sword on guard [m]: 0.32 to the pommel, 0.53 of sword."""


def require_number(
    name: str, value: Any, low: float = -math.inf, high: float = math.inf, *, strict: bool = False
) -> None:
    """Raise `InputError` unless a value of any type is a finite number from `low` to `high`.

    With `strict` the lower bound itself is refused; `name` is that of the value in the message.
    """
    is_allowed = isinstance(value, Real) and math.isfinite(value) and low <= float(value) <= high
    if is_allowed and not (strict and value == low):
        return
    if high < math.inf:
        allowed = f"a number {low:g} .. {high:g}"
    else:
        bound = "" if low == -math.inf else f" above {low:g}" if strict else f", at least {low:g}"
        allowed = f"a finite number{bound}"
    raise InputError(f"{name} = {value!r}, must be {allowed}")


def _require_numbers(
    constants: DataclassInstance,
    *,
    positive: Collection[str] = (),
    signed: Collection[str] = (),
    shares: Collection[str] = (),
) -> None:
    """Raise `InputError` unless all numbers and ranges (low, high) of a dataclass are finite and at least 0.

    Fields of other types are not checked. Of the constants named, those in `positive` must be above 0, those
    in `signed` may be negative, and those in `shares` must be at most 1.
    """
    for field in fields(constants):
        name, value = f"{type(constants).__name__}.{field.name}", getattr(constants, field.name)
        low = -math.inf if field.name in signed else 0.0
        high = 1.0 if field.name in shares else math.inf
        if field.type in ("float", "int"):
            require_number(name, value, low, high, strict=field.name in positive)
        if field.type == "int" and value != int(value):
            raise InputError(f"{name} = {value!r}, must be a whole number")
        if field.type == "tuple[float, float]":
            _require_range(name, value, low, high)


def _require_range(name: str, value: Any, low: float, high: float) -> None:
    try:
        first, last = value
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} = {value!r}, must be two numbers: low, high") from error
    require_number(f"{name}[0]", first, low, high)
    require_number(f"{name}[1]", last, low, high)
    if first > last:
        raise InputError(f"{name} = {value!r}, must have the lower number first")


@dataclass(frozen=True)
class Technique:
    """One way to strike; all values but `swing_s` are this project's choice."""

    name: str
    """The target: do (trunk) and nodo (throat) are thrusts, men (head) and kote (forearm) are cuts."""
    swing_s: float
    """Time from the start of the sword's forward motion to the hit [s]; published for kendo: 0.09 to 0.15."""
    reach_m: float
    """Largest distance of the tip, step included, from where the opponent stood [m]."""
    width_m: float
    """Width, across the strike, within which the target is hit [m]."""
    depth_m: float
    """How far behind the aimed place the target is still hit [m]."""
    blade_m: float
    """How far before the aimed place the target is still hit [m]: in a thrust the whole sword, in a cut the
    part of the blade that counts."""
    target_m: float
    """Position of the target on the robot, ahead of its centre [m]."""
    target_height_m: float
    """Height of the target over the floor [m]."""
    raised_tip_m: float
    """Distance from the opponent's centre to the tip when the sword is drawn back [m]."""
    raised_height_m: float
    """Height of the tip when the sword is drawn back [m]."""

    def __post_init__(self) -> None:
        _require_numbers(self, signed=("target_m",))


TECHNIQUES: Final = (
    Technique("do", 0.12, 1.86, 0.24, 0.13, 1.0, 0.05, 0.42, 0.62, 0.38),
    Technique("nodo", 0.10, 2.05, 0.14, 0.13, 1.0, 0.05, 0.58, 0.58, 0.66),
    Technique("men", 0.15, 2.05, 0.18, 0.13, 0.35, 0.02, 0.68, 0.45, 1.05),
    Technique("kote", 0.09, 1.78, 0.18, 0.12, 0.35, 0.28, 0.46, 0.70, 0.84),
)


@dataclass(frozen=True)
class Opponent:
    """How the opponent fights; the defaults are the difficulty "normal" and this project's choice.

    `mecanum_env.tankendo.opponents` has the range of each parameter with its source, and distributions.
    """

    warning_s: tuple[float, float] = (0.44, 0.58)
    """Range of the time from the first visible motion to the hit [s]; published for kendo: 0.44 to 0.58."""
    sight_delay_s: float = 0.20
    """Delay with which it sees the robot [s]."""
    lead: float = 1.0
    """Share of the robot's motion, as seen and extrapolated to the hit, that it adds to its aim."""
    lead_form: LeadForm = "adaptive"
    """What it extrapolates: "none", nothing; "constant_velocity", the velocity that it saw last; "adaptive",
    of that velocity only the change since the sword rose in full, and of the velocity with which the robot
    waited the share `habit`. A robot that waits in motion can go on or reverse, and the opponent commits to
    neither."""
    habit: float = 0.7
    """Share of the robot's waiting motion that an adaptive opponent expects to go on until the hit."""
    aim_noise_m: float = 0.02
    """Standard deviation of its aim along each axis [m]."""
    extra_reach_m: float = 0.0
    """Added to the reach of every technique [m]."""
    extra_size_m: float = 0.0
    """Added to width and depth of every technique [m]."""
    patience_s: tuple[float, float] = (0.3, 1.2)
    """Range of the time for which the robot must offer an opening before it strikes [s]."""
    feint_probability: float = 0.3
    """Probability that a feint, drawing the sword back and lowering it, precedes the strike."""
    feint_s: tuple[float, float] = (0.16, 0.28)
    """Range of the time for which the sword rises in a feint [s]."""
    lower_s: float = 0.3
    """Time that the sword takes back to guard after a feint [s]."""
    step_m: float = 0.35
    """How far its body steps forward in a strike [m]; part of the reach."""
    recovery_s: float = 0.7
    """Time from the hit until it is on guard where it stood [s]."""
    walk_m_s: float = 0.7
    """Largest walking speed [m/s]."""
    walk_m_s2: float = 3.0
    """Largest change of the walking velocity [m/s^2]."""
    drift_m_s: float = 0.12
    """Largest speed of its sideways walk around the robot, to either side [m/s]."""
    turn_rad_s: float = 4.0
    """Largest turning speed [rad/s]."""
    wander_m_s: float = 0.45
    """Root mean square speed of its walk in the tracking task, along each axis [m/s]."""
    techniques: tuple[Technique, ...] = TECHNIQUES
    """Its techniques, each equally probable."""

    def __post_init__(self) -> None:
        _require_numbers(
            self,
            signed=("lead", "habit", "extra_reach_m", "extra_size_m"),
            shares=("feint_probability",),
        )
        require_one_of("Opponent.lead_form", self.lead_form, LEAD_FORMS)
        if not self.techniques or not all(isinstance(one, Technique) for one in self.techniques):
            raise InputError(f"Opponent.techniques = {self.techniques!r}, must be at least one Technique")


_OPPONENTS: Final[Mapping[str, Opponent]] = {
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
    require_one_of("difficulty", difficulty, _OPPONENTS)
    return _OPPONENTS[difficulty]


@dataclass(frozen=True)
class Rules:
    """The two rules that keep the task from being won by fleeing, and what ends an episode.

    Field and maai are the sport's; the other values are this project's choice.
    """

    maai_m: float = 2 * GUARD_TIP_M
    """Striking distance between the centres, at which the tips meet [m]."""
    band_m: float = 0.25
    """Deviation from maai that still counts as at maai [m]."""
    facing_rad: float = 0.35
    """Bearing of the opponent, from the robot's forward axis, up to which the robot faces it [rad]."""
    slow_m_s: float = 0.25
    """Speed above which the robot offers no opening [m/s]."""
    return_s: float = 1.0
    """Time after the strike at which the robot must be at maai and facing [s]."""
    clash_m: float = 0.65
    """Distance of the centres below which players clash, which ends the episode [m]."""
    field_m: float = 9.0
    """Side of the square field, which the robot must not leave [m]."""
    start_m: tuple[float, float] = (2.2, 2.8)
    """Range of the distance at the start [m]."""
    start_offset_m: float = 0.5
    """Largest offset of the robot's starting position along each axis [m]."""
    start_yaw_rad: float = 0.3
    """Largest error of the robot's heading at the start [rad]."""
    dodge_time_s: float = 12.0
    """Time limit of the dodge [s]."""
    track_time_s: float = 15.0
    """Length of the tracking task [s]."""
    track_settle_s: float = 3.0
    """Time before tracking counts [s]."""
    track_share: float = 0.8
    """Share of the counted time at maai and facing from which tracking is a success."""
    duel_time_s: float = 60.0
    """Time limit of the duel [s]."""
    duel_points: int = 2
    """Points that win the duel: best of three."""
    duel_pause_s: float = 1.0
    """Time after a point without a strike [s]."""
    own_reach_m: float = 1.45
    """Distance up to which the robot's sword reaches the opponent's centre [m]."""
    own_aim_rad: float = 0.15
    """Bearing of the opponent up to which the robot starts its strike [rad]; twice this at the hit."""
    own_strike_s: float = 0.2
    """Time from the start of the robot's strike to its hit [s]."""

    def __post_init__(self) -> None:
        times = ("dodge_time_s", "track_time_s", "duel_time_s")
        positive = ("maai_m", "band_m", "facing_rad", "field_m", "duel_points", *times)
        _require_numbers(self, positive=positive, shares=("track_share",))

    def at_maai(self, distance_m: Number, bearing_rad: Number) -> Number:
        """Return whether the robot is at maai and faces the opponent."""
        is_near = abs(distance_m - self.maai_m) <= self.band_m
        return is_near & (abs(bearing_rad) <= self.facing_rad)


@dataclass(frozen=True)
class Sensors:
    """Delay and noise (standard deviations) of the robot's sensors, where `senses` do not replace them.

    The values are this project's choice, for a camera and wheel odometry.
    """

    delay_s: float = 0.05
    """Age of everything that is observed but the command [s]."""
    position_m: float = 0.01
    """Noise of the positions and heights of the opponent and its tip [m]."""
    velocity_m_s: float = 0.05
    """Noise of the opponent's velocity [m/s]."""
    tip_velocity_m_s: float = 0.1
    """Noise of the tip's velocity [m/s]."""
    own_velocity_m_s: float = 0.02
    """Noise of the robot's own velocity [m/s]."""
    own_yaw_rate_rad_s: float = 0.02
    """Noise of its own yaw rate [rad/s]."""
    place_m: float = 0.02
    """Noise of its own position in the field [m]."""
    heading_rad: float = 0.01
    """Noise of the cosine and sine of its own heading [rad]."""

    def __post_init__(self) -> None:
        _require_numbers(self)


@dataclass(frozen=True)
class RewardWeights:
    """Weights of the reward terms; the formulae are in `TankendoEnv`."""

    distance: float = 0.02
    """Penalty of a step at one band's width from maai; it grows with the distance up to three times this."""
    facing: float = 0.01
    """Penalty of a step at the largest bearing that counts as facing; it grows up to three times this."""
    effort: float = 0.005
    """Penalty of a change of the command from full speed one way to standing."""
    waiting: float = 0.02
    """Penalty of a step before the strike has come; in the duel, of every step. Without it, a policy learns
    never to offer an opening, which loses nothing."""
    hit: float = 1.0
    """Penalty of being hit."""
    success: float = 1.0
    """Reward of a success; in the duel, of each point."""
    out: float = 1.0
    """Penalty of leaving the field or clashing."""

    def __post_init__(self) -> None:
        _require_numbers(self, signed=[field.name for field in fields(self)])

    def replaced(self, values: Mapping[str, float]) -> RewardWeights:
        """Return a copy with some values replaced by name.

        Raises:
            InputError: a name that is no term, or a value that is no number.
        """
        known = [field.name for field in fields(self)]
        for name, value in values.items():
            if name not in known:
                suggestion = did_you_mean(name, known)
                raise InputError(f"reward_weights: no term {name!r}{suggestion}; known: {', '.join(known)}")
            require_number(f"reward_weights: {name}", value)
        return replace(self, **{name: float(value) for name, value in values.items()})
