"""A readable correction of predicted channels, found by regression of their residuals.

Its terms are functions of command, prediction and time. None of them uses a measurement, so that a correction
can be added to any prediction.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.kinematics import WHEELS, wheels_to_body
from mecanum_env.model import Model
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.compare.samples import HeldCommand, wheel_of
from sysid.logs import Run
from sysid.logs.runs import UNITS

KEY: Final = "empirical"
"""Field of a model file that holds an adopted correction."""
_LABEL: Final = "added to the predicted channel; found by regression on what was left over, not physics"
"""Explanation that the model file gives with it."""
_HARMONICS: Final = tuple(range(1, 13))
"""Harmonics of the wheel angle: the first is an uneven wheel or encoder, the tenth the ten rollers."""
_DECAYS_S: Final = (0.1, 0.5)
"""Time constants of the memory of a change of command [s]."""
_LONGEST_MEMORY_S: Final = 10.0
"""Largest value of the time since a change of command [s]."""


@dataclass(frozen=True, eq=False)
class Feature:
    """A candidate for a term: one column, or a sine and a cosine that belong together."""

    name: str
    """As written in a formula; of a pair, the angle."""
    unit: str
    """Unit of the columns; empty for a pure number."""
    columns: FloatArray
    """Shape (n, 1), or (n, 2) for sine and cosine."""


def features(
    channel: str, time_s: FloatArray, wheels: HeldCommand, predicted: FloatArray
) -> dict[str, Feature]:
    """Return the features of a channel, as `predicted` at two or more times, by name.

    A wheel's speed follows that wheel's command, a velocity the body's. Times [s] and values have shape (n,).
    """
    of_a_wheel = wheels.level_rpm.shape[1] == 1 or wheel_of(channel)
    more = _of_a_wheel(channel, time_s, wheels, predicted) if of_a_wheel else _of_the_body(time_s, wheels)
    found = (*_general(time_s, wheels, UNITS[channel], predicted), *more)
    return {feature.name: feature for feature in found}


def _general(
    time_s: FloatArray, wheels: HeldCommand, unit: str, predicted: FloatArray
) -> tuple[Feature, ...]:
    rate = np.gradient(predicted, time_s)
    one = np.ones(time_s.size)
    return (
        _column("1", "", one),
        _column("prediction", unit, predicted),
        _column("|prediction|", unit, np.abs(predicted)),
        _column("sign(prediction)", "", np.sign(_clean(predicted))),
        _column("prediction |prediction|", f"{unit}^2", predicted * np.abs(predicted)),
        _column("rate of the prediction", f"{unit}/s", rate),
        _column("|rate of the prediction|", f"{unit}/s", np.abs(rate)),
        _column("time in the run", "s", time_s),
        _column("prediction x time in the run", f"{unit} s", predicted * time_s),
        _column("time since the command changed", "s",
                np.minimum(wheels.since_change_s(time_s), _LONGEST_MEMORY_S)),
    )  # fmt: skip


def _of_a_wheel(
    channel: str, time_s: FloatArray, wheels: HeldCommand, predicted: FloatArray
) -> Iterator[Feature]:
    own = wheels
    if wheel := wheel_of(channel):
        index = WHEELS.index(wheel)
        own = HeldCommand(wheels.change_s, wheels.level_rpm[:, index : index + 1])
    command = own.at(time_s)[:, 0]
    previous = own.before_change(time_s)[:, 0]
    yield _column("command", "rpm", command)
    yield _column("|command|", "rpm", np.abs(command))
    yield _column("sign(command)", "", np.sign(command))
    yield _column("command |command|", "rpm^2", command * np.abs(command))
    yield _column("command^2", "rpm^2", command**2)
    yield _column("previous command", "rpm", previous)
    since = own.since_change_s(time_s)
    for decay_s in _DECAYS_S:
        fading = (command - previous) * np.exp(-since / decay_s)
        yield _column(f"change of the command x exp(-time since / {decay_s:g} s)", "rpm", fading)
    turned = np.diff(time_s) * 0.5 * (predicted[1:] + predicted[:-1])
    angle = RAD_S_PER_RPM * np.concatenate([[0.0], np.cumsum(turned)])
    for n in _HARMONICS:
        pair = np.stack([np.sin(n * angle), np.cos(n * angle)], axis=1)
        turns = "wheel angle" if n == 1 else f"{n} x wheel angle"
        yield Feature(turns, "", pair)
        yield Feature(f"prediction, {turns}", "rpm", predicted[:, None] * pair)


def _of_the_body(time_s: FloatArray, wheels: HeldCommand) -> Iterator[Feature]:
    body = wheels_to_body(wheels.at(time_s))
    parts = dict(zip(("forward", "left", "turn"), body.T, strict=True))
    for name, values in parts.items():
        yield _column(f"{name} command", "rpm", values)
        yield _column(f"|{name} command|", "rpm", np.abs(values))
        yield _column(f"sign({name} command)", "", np.sign(_clean(values)))
    for one, other in (("forward", "left"), ("forward", "turn"), ("left", "turn")):
        yield _column(f"{one} x {other} command", "rpm^2", parts[one] * parts[other])


def _column(name: str, unit: str, values: FloatArray) -> Feature:
    return Feature(name, unit, values[:, None])


def _clean(values: FloatArray) -> FloatArray:
    """Return the values with those below a thousandth of the largest as 0, whose sign would be random."""
    largest = float(np.max(np.abs(values), initial=0.0))
    return np.where(np.abs(values) > 1e-3 * largest, values, 0.0)


@dataclass(frozen=True)
class Term:
    """A feature with its coefficient, or its two of sine and cosine."""

    feature: str
    coefficients: tuple[float, ...]


@dataclass(frozen=True)
class Correction:
    """Terms that are added to predicted channels."""

    terms: Mapping[str, tuple[Term, ...]]
    """Channel -> its terms."""
    explained: Mapping[str, float]
    """Channel -> explained share of the squared error, on command sequences left out of the regression."""

    def added(
        self, channel: str, time_s: FloatArray, wheels: HeldCommand, predicted: FloatArray
    ) -> FloatArray:
        """Return a `predicted` channel, shape (n,), with the correction; unchanged if it has no terms.

        The times [s] are counted from the start of the run, shape (n,).

        Raises:
            InputError: a term with an unknown feature.
        """
        terms = self.terms.get(channel, ())
        if not terms or time_s.size < 2:
            return predicted
        known = features(channel, time_s, wheels, predicted)
        total = np.array(predicted, float)
        for term in terms:
            if term.feature not in known or len(term.coefficients) != known[term.feature].columns.shape[1]:
                raise InputError(
                    f"{KEY}: {channel} has no term {term.feature!r}{did_you_mean(term.feature, known)}"
                )
            total += known[term.feature].columns @ np.array(term.coefficients)
        return total

    def added_to(self, run: Run, predicted: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Return all `predicted` channels of a run, each of shape (n,), with the correction."""
        wheels = HeldCommand(*run.command_changes())
        return {name: self.added(name, run.time_s, wheels, values) for name, values in predicted.items()}

    def as_json(self) -> dict[str, Any]:
        """Return the value of the model file's field `KEY`."""
        return {
            "what": _LABEL,
            "channels": {
                channel: [{"feature": t.feature, "coefficients": list(t.coefficients)} for t in terms]
                for channel, terms in self.terms.items()
            },
            "explained": dict(self.explained),
        }


def correction_of(model: Model) -> Correction | None:
    """Return the correction that a `model` file holds, None if it holds none.

    Raises:
        InputError: the field is not in the form of `Correction.as_json`.
    """
    stored = model.extra.get(KEY)
    if stored is None:
        return None
    try:
        terms = {
            str(channel): tuple(Term(str(t["feature"]), tuple(map(float, t["coefficients"]))) for t in parts)
            for channel, parts in stored["channels"].items()
        }
        explained = {str(channel): float(share) for channel, share in stored.get("explained", {}).items()}
    except (TypeError, KeyError, ValueError, AttributeError) as error:
        raise InputError(
            f"{KEY}: must hold channels, each a list of feature and coefficients, as python -m sysid.gap "
            "--empirical writes them"
        ) from error
    return Correction(terms, explained)


def formula(channel: str, terms: Sequence[Term]) -> str:
    """Return terms in a channel's unit, as in "-0.03 x command + 3.9 rpm x sin(wheel angle + 12 deg)"."""
    still = HeldCommand(np.zeros(1), np.zeros((1, 4 if channel != "speed_rpm" else 1)))
    known = features(channel, np.array([0.0, 1.0]), still, np.zeros(2))
    text = " + ".join(_term_text(UNITS[channel], known[term.feature], term) for term in terms)
    return text.replace("+ -", "- ")


def _term_text(unit: str, feature: Feature, term: Term) -> str:
    per = unit if not feature.unit else "" if feature.unit == unit else f"{unit} per {feature.unit}"
    if len(term.coefficients) == 1:
        value = f"{term.coefficients[0]:.3g}{' ' + per if per else ''}"
        return value if feature.name == "1" else f"{value} x {feature.name}"
    sine, cosine = term.coefficients
    factor, _, angle = feature.name.rpartition(", ")
    phase = math.degrees(math.atan2(cosine, sine))
    value = f"{math.hypot(sine, cosine):.3g}{' ' + per if per else ''}"
    wave = f"sin({angle} {'-' if phase < 0 else '+'} {abs(phase):.0f} deg)"
    return " x ".join(filter(None, (value, factor, wave)))
