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


def delay_of(model: Model) -> float:
    """Return the common delay of a model's commands [s], in either form."""
    effects = model.effects.get(JITTER) or model.effects.get(_FIXED) or {}
    return float(effects.get("delay_s", 0.0))


def varies(model: Model) -> bool:
    """Return whether a model's link delays every change of the command differently, or loses some."""
    return bool({JITTER, LOSS} & set(model.effects))


def said(model: Model) -> str:
    """Return in a few words what a model says of its link."""
    effects = model.effects
    delay = f"{delay_of(model) * 1e3:.0f}"
    jitter = f" and {effects[JITTER]['jitter_s'] * 1e3:.0f}" if JITTER in effects else ""
    lost = f", {effects[LOSS]['share']:.1%} of the commands lost" if LOSS in effects else ""
    return f"{delay}{jitter} ms{lost}"


def on_time(model: Model, period_s: float, delay_s: float = 0.0) -> Model:
    """Return the model with one delay [s] for all commands, none lost, and a clock of `period_s` [s]."""
    effects = _without_link(model)
    if delay_s > 0.0:
        effects = {_FIXED: {"delay_s": delay_s}, **effects}
    return replace(model, wheel=replace(model.wheel, command_period_s=period_s), effects=effects)


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
