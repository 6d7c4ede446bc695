"""What a left-over error may go with: readable functions of command, prediction and time.

Nothing measured is among them, so a correction made of them can be added to any prediction.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.kinematics import wheels_to_body
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.compare.samples import HeldCommand, wheel_of
from sysid.logs.runs import UNITS

HARMONICS: Final = tuple(range(1, 13))
"""Of the wheel's turn that are tried: once a turn is an uneven wheel or encoder, ten are the rollers."""
DECAYS_S: Final = (0.1, 0.5)
"""Time constants with which the memory of a command's change fades."""
LONGEST_MEMORY_S: Final = 10.0


@dataclass(frozen=True, eq=False)
class Feature:
    """One candidate: a column, or a sine and a cosine that are taken together."""

    name: str
    """As in a formula; of a pair, the angle."""
    unit: str
    """Of the columns; empty for a pure number."""
    columns: FloatArray
    """Shape (n, 1), or (n, 2) for sine and cosine."""


def features(
    channel: str, time_s: FloatArray, wheels: HeldCommand, predicted: FloatArray
) -> dict[str, Feature]:
    """Return the candidates of a channel by name.

    Args:
        channel: column of the log; a wheel's speed follows its own command, a velocity the body's.
        time_s: of the samples [s], shape (n,), n >= 2.
        wheels: commands of the wheels.
        predicted: the channel as the model has it, shape (n,).
    """
    found = _general(time_s, wheels, UNITS[channel], predicted)
    if wheels.level_rpm.shape[1] == 1 or wheel_of(channel):
        found = (*found, *_of_a_wheel(channel, time_s, wheels, predicted))
    else:
        found = (*found, *_of_the_body(time_s, wheels))
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
                np.minimum(wheels.since_change_s(time_s), LONGEST_MEMORY_S)),
    )  # fmt: skip


def _of_a_wheel(
    channel: str, time_s: FloatArray, wheels: HeldCommand, predicted: FloatArray
) -> Iterator[Feature]:
    own = wheels
    wheel = wheel_of(channel)
    if wheel is not None:
        index = ("fl", "fr", "rl", "rr").index(wheel)
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
    for decay_s in DECAYS_S:
        fading = (command - previous) * np.exp(-since / decay_s)
        yield _column(f"change of the command x exp(-time since / {decay_s:g} s)", "rpm", fading)
    angle = RAD_S_PER_RPM * np.concatenate([[0.0], np.cumsum(_trapezia(time_s, predicted))])
    for n in HARMONICS:
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
    """Return values with what is next to nothing at 0, so that its sign is not chance."""
    largest = float(np.max(np.abs(values), initial=0.0))
    return np.where(np.abs(values) > 1e-3 * largest, values, 0.0)


def _trapezia(time_s: FloatArray, values: FloatArray) -> FloatArray:
    return np.diff(time_s) * 0.5 * (values[1:] + values[:-1])
