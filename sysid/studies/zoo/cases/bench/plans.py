"""Command plans: what a user sends to a wheel on the bench, by name."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sysid.studies.zoo.cases.bench.change import sign

Commands = NDArray[np.float64]
"""One command [rpm] per period of the link, (m,)."""


def plan(name: str, top_rpm: float, seconds: float, period_s: float, rng: np.random.Generator) -> Commands:
    """Return the commands of one run of a plan [rpm], whole numbers of at most `top_rpm` in size, (m,).

    Every run begins with one or two zeros; of recordings that begin with a step they are cut off later
    (`sysid.studies.zoo.cases.beginning`).

    Raises:
        KeyError: `name` is none of `PLANS`.
    """
    count = max(4, round(seconds / period_s))
    shape = PLANS[name](period_s * np.arange(count, dtype=np.float64), rng)
    shape[: 1 + int(rng.integers(2))] = 0.0
    top = math.floor(top_rpm)
    commands: Commands = np.clip(np.rint(shape * top), -top, top)
    return commands


def _holds(time_s: Commands, lengths_s: Commands, levels: Commands) -> Commands:
    """Return levels (k,) held for lengths (k,), the last one to the end, at the given times (m,)."""
    at = np.searchsorted(np.cumsum(lengths_s), time_s, side="right")
    return levels[np.minimum(at, levels.size - 1)]


def _steps(time_s: Commands, rng: np.random.Generator) -> Commands:
    """Return one step up from rest and one down to rest or to another level of the same direction."""
    end = time_s[-1]
    level, after = sign(rng) * rng.uniform(0.25, 1.0), rng.choice((0.0, rng.uniform(0.1, 0.6)))
    lengths = np.array([0.1, rng.uniform(0.4, 0.6)]) * end
    return _holds(time_s, lengths, np.array([0.0, level, level * after]))


def _staircase(time_s: Commands, rng: np.random.Generator) -> Commands:
    """Return equal steps up to a highest level and down again."""
    stairs = int(rng.integers(3, 6))
    up = np.linspace(0.0, sign(rng) * rng.uniform(0.6, 1.0), stairs + 1)
    levels = np.concatenate((up, up[-2:0:-1]))
    return _holds(time_s, np.full(levels.size, time_s[-1] / levels.size), levels)


def _reversals(time_s: Commands, rng: np.random.Generator) -> Commands:
    """Return steps from one direction to the other, at levels and lengths of their own."""
    count = max(4, int(time_s[-1] / 0.6))
    signs = sign(rng) * (-1.0) ** np.arange(count)
    return _holds(time_s, rng.uniform(0.4, 0.9, count), signs * rng.uniform(0.2, 1.0, count))


def _random_holds(time_s: Commands, rng: np.random.Generator) -> Commands:
    """Return random levels of both directions, held for random times."""
    count = max(4, int(time_s[-1] / 0.3))
    return _holds(time_s, rng.uniform(0.2, 0.9, count), rng.uniform(-1.0, 1.0, count))


def _slow_near_zero(time_s: Commands, rng: np.random.Generator) -> Commands:
    """Return small levels of both directions and zeros: fine positioning."""
    count = max(4, int(time_s[-1] / 0.4))
    levels = _signs(count, rng) * rng.uniform(0.02, 0.25, count)
    levels[rng.random(count) < 0.2] = 0.0
    return _holds(time_s, rng.uniform(0.3, 0.9, count), levels)


def _signs(count: int, rng: np.random.Generator) -> Commands:
    signs: Commands = rng.choice((-1.0, 1.0), count)
    return signs


def _sweep(time_s: Commands, rng: np.random.Generator) -> Commands:
    """Return a sine whose frequency rises, up to a fifth of the link's rate or 3 Hz."""
    period = time_s[1] - time_s[0]
    end = max(time_s[-1], period)
    low, high = 0.3, min(3.0, 0.2 / period)
    phase = 2.0 * np.pi * (low * time_s + 0.5 * (high - low) * time_s**2 / end)
    shape: Commands = sign(rng) * rng.uniform(0.4, 0.9) * np.sin(phase)
    return shape


def _joystick(time_s: Commands, rng: np.random.Generator) -> Commands:
    """Return a stick that a hand moves: targets that change, approached smoothly, with rests at zero."""
    count = max(3, int(time_s[-1] / 0.8))
    levels = rng.uniform(-1.0, 1.0, count)
    levels[rng.random(count) < 0.25] = 0.0
    targets = _holds(time_s, rng.uniform(0.4, 1.4, count), levels)
    share = 1.0 - np.exp(-(time_s[1] - time_s[0]) / rng.uniform(0.05, 0.25))
    stick = np.zeros_like(targets)
    for i in range(1, stick.size):
        stick[i] = stick[i - 1] + share * (targets[i] - stick[i - 1])
    return stick


def _gentle_forward(time_s: Commands, rng: np.random.Generator) -> Commands:
    """Return slow ramps up to less than half of the top speed, forwards, and a slow swing about it."""
    rise = 0.6 * max(1.2, 0.5 * min(time_s[-1], 5.0))
    level, swing = rng.uniform(0.25, 0.4), rng.uniform(0.02, 0.06)
    slow = swing * np.sin(2.0 * np.pi * rng.uniform(0.15, 0.3) * time_s)
    shape: Commands = np.minimum(time_s / rise, 1.0) * (level + slow)
    return shape


PLANS: Final[Mapping[str, Callable[[Commands, np.random.Generator], Commands]]] = {
    "steps": _steps,
    "staircase": _staircase,
    "reversals": _reversals,
    "random_holds": _random_holds,
    "slow_near_zero": _slow_near_zero,
    "sweep": _sweep,
    "joystick": _joystick,
    "gentle_forward": _gentle_forward,
}
"""Plan -> function of the times of the commands, which returns shares of the top speed."""

FIT_PLANS: Final = ("steps", "staircase", "reversals", "random_holds", "joystick")
"""Plans that a user would fit a model to."""

CASE_PLANS: Final = ("steps", "staircase", "reversals", "random_holds", "slow_near_zero", "sweep", "joystick")
"""Plans of the logs in which something is hidden."""

GENTLE: Final = "gentle_forward"
"""The plan that cannot show what happens in reverse, at rest, at speed or in a hurry."""
