"""Opponents as parameters with ranges and sources, and distributions from which episodes draw them.

    Opponents(Opponent(), {"sight_delay_s": (0.15, 0.30), "lead_form": ("adaptive", "constant_velocity")})

draws each number uniformly between its ends and each form uniformly from those named. A parameter that is
itself a range (`patience_s`) is drawn as a narrower one: both of its ends, the lower first.

Sources of `PARAMETERS`, by the key in brackets:

- [kendo] 0.09 to 0.15 s from the start of the sword's forward motion to the hit, 0.44 to 0.58 s from the
  signal that starts a fast attack; a target reached within 0.10 s also in "Men-uchi", Proceedings 49 (1), 93,
  2020.
- [reaction] Simple visual reactions of trained people take 0.15 to 0.30 s; expert kendo players were filmed
  below 0.2 s. Level does not decide: M. Gutierrez-Davila et al., "Response timing in the lunge and target
  change in elite versus medium-level fencers", European Journal of Sport Science 13 (4), 2013.
- [lunge] Elite fencers need 0.353 +- 0.028 s to begin and carry out a defence, and a feint does not change
  it: M. Gutierrez-Davila et al., Journal of Applied Biomechanics 32 (6), 2016. An attack with a step and a
  lunge is visible for longer than a kendo cut.
- [interception] People who catch a moving target extrapolate the velocity that they saw last, neither more
  nor less, and miss targets that change it: "Differential integration of acceleration", bioRxiv, on pursuit
  and manual interception of accelerating targets.
- [assumed] This project's own: no source states it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.tankendo.constants import LEAD_FORMS, Opponent, Technique, opponent_for

Ends = tuple[float, float] | tuple[str, ...]
"""The ends of a uniform draw, or the names of forms that are drawn."""


@dataclass(frozen=True)
class OpponentParameter:
    """One parameter of the opponent."""

    name: str
    """Field of `Opponent`, or "swing_scale", the factor on every technique's time."""
    meaning: str
    unit: str
    ends: Ends
    """The range that people are known, or assumed, to have; for forms all of them."""
    source: str
    """Key in the head of this file."""


PARAMETERS: Final = (
    OpponentParameter("sight_delay_s", "delay with which it sees the robot", "s", (0.15, 0.30), "reaction"),
    OpponentParameter("lead_form", "what of the robot's motion it extrapolates", "", LEAD_FORMS, "assumed"),
    OpponentParameter("lead", "share of that motion it adds to its aim", "1", (0.7, 1.1), "interception"),
    OpponentParameter("habit", "share of the waiting motion it expects to go on", "1", (0.4, 0.9), "assumed"),
    OpponentParameter(
        "extra_reach_m", "added to the reach of every technique", "m", (-0.08, 0.08), "assumed"
    ),
    OpponentParameter("swing_scale", "time of every technique over its usual", "1", (0.9, 1.5), "kendo"),
    OpponentParameter("warning_s", "first visible motion to the hit", "s", (0.40, 0.75), "kendo, lunge"),
    OpponentParameter("aim_noise_m", "standard deviation of its aim", "m", (0.01, 0.04), "assumed"),
    OpponentParameter("feint_probability", "rate of feints before a strike", "1", (0.1, 0.5), "assumed"),
    OpponentParameter("feint_s", "how long the sword rises in a feint", "s", (0.14, 0.30), "assumed"),
    OpponentParameter("patience_s", "rhythm: opening needed before it strikes", "s", (0.2, 1.6), "assumed"),
    OpponentParameter("recovery_s", "rest: from the hit to guard again", "s", (0.4, 1.0), "assumed"),
    OpponentParameter("walk_m_s", "largest walking speed", "m/s", (0.5, 0.9), "assumed"),
    OpponentParameter("drift_m_s", "largest sideways speed while waiting", "m/s", (0.0, 0.2), "assumed"),
)
"""All parameters that a distribution may draw, with the range of people."""
_SWING: Final = "swing_scale"
RANGED: Final = frozenset(one.name for one in fields(Opponent) if one.type == "tuple[float, float]")
"""Parameters that are themselves ranges."""


@dataclass(frozen=True)
class Opponents:
    """A distribution of opponents: `base` with the parameters in `ranges` drawn anew for each episode.

    Raises:
        InputError: a parameter that is none, or ends that an opponent cannot have.
    """

    base: Opponent = field(default_factory=Opponent)
    """What is not drawn is as here."""
    ranges: Mapping[str, Ends] = field(
        default_factory=lambda: {one.name: one.ends for one in PARAMETERS if one.name != "lead_form"}
    )
    """Name -> ends of the uniform draw, or the forms; by default the ranges of `PARAMETERS`, but one form."""

    def __post_init__(self) -> None:
        known = [one.name for one in PARAMETERS]
        for name, ends in self.ranges.items():
            if name not in known:
                raise InputError(
                    f"opponent: no parameter {name!r}{did_you_mean(name, known)}; known: {', '.join(known)}"
                )
            if isinstance(ends, str) or not isinstance(ends, tuple | list) or not ends:
                raise InputError(f"opponent: {name} = {ends!r}, must be two numbers or names of forms")
            if name != "lead_form" and (len(ends) != 2 or not float(ends[0]) <= float(ends[1])):
                raise InputError(f"opponent: {name} = {ends!r}, must be two numbers, the lower first")
            # What an opponent cannot have is refused by the opponent itself.
            for end in ends:
                with_parameters(self.base, {name: (end, end) if name in RANGED else end})
        ordered = {name: tuple(self.ranges[name]) for name in sorted(self.ranges)}
        object.__setattr__(self, "ranges", MappingProxyType(ordered))

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how to make a copy; a read-only mapping cannot be copied itself."""
        return type(self), (self.base, dict(self.ranges))

    @property
    def sight_delay_s(self) -> float:
        """The longest sight delay that may be drawn [s]."""
        return float(self.ranges.get("sight_delay_s", (0.0, self.base.sight_delay_s))[1])

    def draw(self, rng: np.random.Generator) -> Opponent:
        """Return an opponent drawn with the generator `rng`."""
        drawn: dict[str, Any] = {}
        for name, ends in self.ranges.items():
            if name == "lead_form":
                drawn[name] = ends[int(rng.integers(len(ends)))]
                continue
            low, high = float(ends[0]), float(ends[1])
            if name in RANGED:
                first, second = low + (high - low) * np.sort(rng.random(2))
                drawn[name] = float(first), float(second)
            else:
                drawn[name] = low + (high - low) * float(rng.random())
        # Between ends that were checked every number is right, and to check it takes longer than to draw it.
        return _with_parameters(self.base, drawn, _unchecked)


OpponentLike = Opponent | Opponents | Mapping[str, Ends]
"""An opponent, a distribution, or ranges around the difficulty's opponent."""


def opponent_to_dict(opponent: Opponent | Opponents) -> dict[str, Any]:
    """Return an opponent, or a distribution of them, as a JSON object."""
    if isinstance(opponent, Opponents):
        ranges = {name: list(ends) for name, ends in opponent.ranges.items()}
        return {**opponent_to_dict(opponent.base), "ranges": ranges}
    return asdict(opponent)


def opponent_from_dict(value: Mapping[str, Any]) -> Opponent | Opponents:
    """Return the opponent or distribution of a JSON object, the `value` of `opponent_to_dict`.

    Names that are absent have their defaults; `difficulty` names another opponent to take them from.

    Raises:
        InputError: an unknown name, or a value that an opponent cannot have.
    """
    numbers = dict(value)
    base = opponent_for(str(numbers.pop("difficulty", "normal")))
    ranges = numbers.pop("ranges", None)
    known = [one.name for one in fields(Opponent)]
    for name in numbers:
        if name not in known:
            raise InputError(f"opponent: no {name!r}{did_you_mean(name, known)}; known: {', '.join(known)}")
    for name in RANGED & numbers.keys():
        numbers[name] = tuple(numbers[name])
    try:
        if "techniques" in numbers:
            numbers["techniques"] = tuple(Technique(**one) for one in numbers["techniques"])
        base = replace(base, **numbers)
    except TypeError as error:
        raise InputError(
            f"opponent: techniques must be objects with the fields of Technique: {error}"
        ) from error
    return base if ranges is None else Opponents(base, {name: tuple(ends) for name, ends in ranges.items()})


def with_parameters(opponent: Opponent, values: Mapping[str, Any]) -> Opponent:
    """Return an opponent with the `values` of some of `PARAMETERS` by name.

    Raises:
        InputError: a value that an opponent cannot have.
    """
    return _with_parameters(opponent, values, replace)


def _with_parameters(opponent: Opponent, values: Mapping[str, Any], changed: Callable[..., Any]) -> Opponent:
    """Return an opponent with other parameters; `changed` copies a dataclass with some fields changed."""
    own = dict(values)
    if _SWING in own:
        scale = float(own.pop(_SWING))
        own["techniques"] = tuple(changed(one, swing_s=scale * one.swing_s) for one in opponent.techniques)
    found: Opponent = changed(opponent, **own)
    return found


def _unchecked(frozen: Any, **fields_of: Any) -> Any:
    """Return what `dataclasses.replace` does, without the checks of the class."""
    copy = object.__new__(type(frozen))
    copy.__dict__.update(frozen.__dict__, **fields_of)
    return copy
