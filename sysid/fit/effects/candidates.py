"""What is tried beside a law: the effects that a drive may have, and the places where their fits start."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from itertools import product
from typing import Final

import numpy as np

from mecanum_env.effects import CATALOGUE, Effect, Parameter
from mecanum_env.effects.scale import Scale
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.search_space import EffectSet, scanned

_STATIONS: Final = ("set_point", "law", "load", "transmission")
"""Where a drive departs from its law."""
_TIMING: Final = ("command_latency", "sensor_lowpass", "sensor_lowpass/window")
"""Effects of the link and the sensor that are searched, too: a law of third order has no room for a delay, a
lag and a counter's window beside the loop."""
_LEFT_OUT: Final = ("battery_sag", "warm_up", "torque_ripple", "load_inertia")
"""Causes that are not searched: those that change during a run, unless a logged column tells how, a ripple
whose phase differs from run to run, and what the law already is on a free wheel."""
_LAW_ITSELF: Final = "viscous_friction"
"""Not searched either: what takes speed in proportion from a drive without integral action is a law of a
smaller gain. Beside a free gain each took the other back (4 of 228 drawn drives had gains of 2 to 3.5 and a
friction that took them back), and made a motor that is far too fast."""
_ANY_LAG: Final = "backlash/spring"
"""Not searched either: a wheel on a spring is a lag of almost any shape, and would stand for whatever a
law of third order lacks. With it in the model, a study no longer sees the gap that comes later."""
_PROBES: Final = (0.03, 0.3)
"""Steps from neutral at which a parameter without a scan is tried, on its scale from 0 to 1."""
TRIED: Final[Mapping[str, tuple[float, ...]]] = {
    "answer_s": (0.0, 0.04),
    "motor_s": (0.02, 0.06, 0.15),
    "brake_rpm_s": (0.0,),
}
"""Parameters that only a fit to logs without a gap determines, and where they are tried."""
_MOST_STARTS: Final = 24
_TIME_CONSTANTS: Final = (0.002, 0.02, 0.06, 0.2, 0.5)
"""Time constants of first-order laws to start from, relative to the largest one allowed. That may be many
seconds where commands are held for long; a descent from slow laws alone would not reach a fast one."""


def first_order_laws(model: Model, largest_pole: float) -> Iterator[Model]:
    """Yield a model with first-order laws, whose poles are below `largest_pole`, and with a free gain."""
    for share in _TIME_CONSTANTS:
        pole = float(largest_pole ** (1.0 / share))
        law = replace(model.wheel.law, A=pole, B=0.0, C=0.0, D=1.0 - pole, E=0.0, F=0.0)
        start = replace(model, wheel=replace(model.wheel, law=law))
        yield start.with_effect("speed_gain", gain=1.0)


def starts(
    effect: Effect, added: EffectSet, scale: Scale, known: Mapping[str, float] | None = None
) -> Iterator[FloatArray]:
    """Yield the places at which an effect is tried: combinations of those of its parameters.

    `added` is the effect as a set with its free parameters; `scale` is that of the drive and the logs. The
    parameters with `known` values, as another form of the effect has them, are tried at those only.
    """
    known = known or {}
    parameters: Mapping[str, Parameter] = {p.name: p for p in effect.parameters}
    choices, has_neutral = [], not known
    for one in added.coordinates:
        parameter = parameters[one.parameter]
        if one.parameter in known:
            choices.append([float(np.clip(one.unit(known[one.parameter]), 0.0, 1.0))])
            continue
        places = scanned(parameter, one, scale)
        if one.parameter in TRIED:
            places = [one.unit(value) for value in TRIED[one.parameter]]
        elif parameter.neutral is not None and not places:
            both = [one.neutral_place + sign * probe for probe in _PROBES for sign in (1.0, -1.0)]
            places = [place for place in both if 0.0 <= place <= 1.0]
        neutral = [one.neutral_place] if parameter.neutral is not None or not places else []
        has_neutral |= bool(neutral)
        choices.append([*neutral, *places])
    combinations = list(product(*choices))[int(has_neutral) :]
    for combination in combinations[:: -(-len(combinations) // _MOST_STARTS)]:
        place = np.array(combination)
        for index, one in enumerate(added.coordinates):
            if one.parameter == "brake_rpm_s" and one.parameter not in known:
                # Braking begins as the limit of rising does.
                limit = added.coordinates[0].value(float(place[0]))
                place[index] = one.unit(limit)
        yield place


def drive_candidates(columns: Collection[str], *, command_falls: bool = True) -> dict[str, Effect]:
    """Return the effects that a drive may have by itself, in the order of the chain.

    `columns` are those of the logs, and `command_falls` says whether a command falls or reverses within any
    of their runs.
    """
    return {
        name: effect
        for name, effect in CATALOGUE.items()
        if effect.searched_in("bench")
        and (effect.station in _STATIONS or name in _TIMING)
        and (effect.reads or effect.cause not in _LEFT_OUT)
        and effect.readable_in(columns)
        and (command_falls or not effect.needs_falling_command)
        and name not in (_ANY_LAG, _LAW_ITSELF)
        # A map has five numbers and stands for what has no simpler name, which a study may then find.
        and effect.search_from is None
    }
