"""The link in a model: its common delay, its jitter and its losses, and models with another one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from mecanum_env.model import Model
from mecanum_env.wheel_drive.drive import longest_delay_s
from mecanum_env.wheel_drive.link import SPREAD

JITTER: Final = "command_latency/jitter"
LOSS: Final = "command_loss"
_FIXED: Final = "command_latency"
_STAMPS: Final = "commands_between_rows"
"""Key in the uncertainty of a model whose logs show each command in the first row after it was given."""
_LATE: Final = "late_s"
"""Key in that: how late such commands act under the model [s], which may take a delay for a lag."""


def delay_of(model: Model) -> float:
    """Return the common delay of a model's commands [s], in either form."""
    effects = model.effects.get(JITTER) or model.effects.get(_FIXED) or {}
    return float(effects.get("delay_s", 0.0))


def varies(model: Model) -> bool:
    """Return whether a model's link delays every change of the command differently, or loses some."""
    return bool({JITTER, LOSS} & set(model.effects))


def late_between_rows(model: Model) -> float | None:
    """Return how late commands act [s] that a model's logs show in the first row after they were given.

    None if the logs show them when they were given.
    """
    stated = model.uncertainty.get(_STAMPS)
    return None if stated is None else float(stated[_LATE])


def with_stamps(model: Model, late_s: float | None) -> Model:
    """Return the model with what `late_between_rows` says of it."""
    uncertainty = {key: value for key, value in model.uncertainty.items() if key != _STAMPS}
    if late_s is not None:
        uncertainty[_STAMPS] = {_LATE: late_s}
    return replace(model, uncertainty=uncertainty)


def said(model: Model) -> str:
    """Return in a few words what a model says of its link."""
    effects = model.effects
    delay = f"{delay_of(model) * 1e3:.0f}"
    jitter = f" and {effects[JITTER]['jitter_s'] * 1e3:.0f}" if JITTER in effects else ""
    lost = f", {effects[LOSS]['share']:.1%} of the commands lost" if LOSS in effects else ""
    return f"{delay}{jitter} ms{lost}"


def on_time(model: Model, period_s: float, delay_s: float = 0.0) -> Model:
    """Return the model with one delay [s] for all commands, none lost, and a clock of `period_s` [s].

    It says that commands are stamped when they are given.
    """
    effects = _without_link(model)
    if delay_s > 0.0:
        effects = {_FIXED: {"delay_s": delay_s}, **effects}
    on_clock = replace(model, wheel=replace(model.wheel, command_period_s=period_s), effects=effects)
    return with_stamps(on_clock, None)


def varied(
    model: Model,
    period_s: float,
    *,
    jitter_s: float | None = None,
    delay_s: float | None = None,
    share: float | None = None,
) -> Model:
    """Return the model with a clock of `period_s` [s], and a link as it is described.

    Its delay jitters by `jitter_s` [s] around `delay_s` [s] (None: around the model's own), as far as the
    drive can remember commands, and it loses this `share` of the commands. What is None stays as it is.
    """
    wheel, effects = replace(model.wheel, command_period_s=period_s), dict(model.effects)
    if jitter_s is not None:
        longest = longest_delay_s(period_s, wheel.law.sample_period_s)
        common = min(delay_of(model) if delay_s is None else delay_s, longest)
        spread = min(jitter_s, (longest - common) / SPREAD)
        effects = {JITTER: {"delay_s": common, "jitter_s": spread}, **_without_link(model)}
    if share is not None:
        effects = {LOSS: {"share": share}, **effects}
    return replace(model, wheel=wheel, effects=effects)


def _without_link(model: Model) -> Mapping[str, Mapping[str, float]]:
    return {name: values for name, values in model.effects.items() if name not in (_FIXED, JITTER, LOSS)}
