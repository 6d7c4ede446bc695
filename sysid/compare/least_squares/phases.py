"""Effects that follow the wheel's angle: the angle at which a run starts is unknown, and so is each phase.

To first order a phase p changes a residual by a cos p + b sin p. The likelihood of a run is its mean over all
phases. In the mean of n repeats, cos p and sin p are about normal with mean 0 and variance 1 / (2 n); its
residual then has the covariance I + Z Z', Z the two columns a and b times that standard deviation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from mecanum_env.effects import CATALOGUE
from mecanum_env.model import Model
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.compare.measured import Block

PHASE: Final = "phase_deg"
_PHASES_DEG: Final = (0.0, 120.0, 240.0)
"""Three phases give mean, sine and cosine of a response, free of its second harmonic in the mean."""
_VARIANCE: Final = 0.5
_ANGLES: Final = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
_CIRCLE: Final = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])
FREQUENCIES: Final = tuple(range(1, 25))
"""Periods per turn that are looked for: a wheel, gear or disk is uneven a whole number of times."""


def with_unknown_phases(
    residual_of: Callable[[Model], FloatArray | None],
    model: Model,
    blocks: Sequence[Block],
    rows: Sequence[slice],
) -> FloatArray | None:
    """Return the whitened residual (N,) of a model whose phases are unknown in each of the `blocks`.

    `residual_of` returns that of a model with its phases as they are, None if it cannot be simulated; `rows`
    are those of each block. The square of the result is minus twice the logarithm of the likelihood, up to a
    constant: what the unknown phases cost is spread over the residual as a factor.
    """
    turning = [name for name in model.effects if CATALOGUE[name].follows_angle and not _neutral(model, name)]
    if not turning:
        return residual_of(model)
    found = [residual_of(_turned(model, turning, phase)) for phase in _PHASES_DEG]
    known = [one for one in found if one is not None]
    if len(known) < len(found):
        return None
    at = np.radians(_PHASES_DEG)
    waves = 2.0 / len(at) * np.stack([np.cos(at), np.sin(at)]) @ np.stack(known)
    result: FloatArray = np.mean(known, axis=0)
    for block, part in zip(blocks, rows, strict=True):
        over = _over_one_phase if block.repeats == 1 else _over_mean_phases
        own, deviance = over(result[part], waves[:, part].T, block.repeats)
        square = float(own @ own)
        result[part] = own * math.sqrt(deviance / square) if square > 0.0 else own
    return result


def _over_one_phase(mean: FloatArray, waves: FloatArray, _repeats: int) -> tuple[FloatArray, float]:
    """Return the residual (n,) at the likeliest phase, and minus twice the log mean likelihood of all."""
    along, gram = waves.T @ mean, waves.T @ waves
    squares = mean @ mean + 2.0 * along @ _CIRCLE + np.sum(_CIRCLE * (gram @ _CIRCLE), axis=0)
    least = int(np.argmin(squares))
    own = mean + waves @ _CIRCLE[:, least]
    # The least square is computed again: as a difference of large ones it may come out below zero.
    over_others = math.log(float(np.mean(np.exp(-0.5 * (squares - squares[least])))))
    return own, float(own @ own) - 2.0 * over_others


def _over_mean_phases(mean: FloatArray, waves: FloatArray, repeats: int) -> tuple[FloatArray, float]:
    """Return the residual (n,) whitened by normal phases, and minus twice its log likelihood."""
    columns = waves * math.sqrt(_VARIANCE / repeats)
    directions, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    spread = np.sqrt(1.0 + sizes**2)
    own = mean + directions @ ((1.0 / spread - 1.0) * (directions.T @ mean))
    return own, float(own @ own) + 2.0 * float(np.sum(np.log(spread)))


def likely_frequencies(
    residual: FloatArray,
    predictions: Sequence[FloatArray],
    blocks: Sequence[Block],
    rows: Sequence[slice],
    most: int,
) -> tuple[int, ...]:
    """Return the periods per turn, `most` of them, of which a whitened residual (N,) has most.

    Each of the `blocks` has its own phase, and the `rows` of it are known. `predictions` are their speeds
    [rpm], from which the angle follows.
    """
    power = np.zeros(len(FREQUENCIES))
    for block, part, speed in zip(blocks, rows, predictions, strict=True):
        if not block.channel.startswith("speed_") or block.time_s.size < 3:
            continue
        angle = np.cumsum(speed * RAD_S_PER_RPM * np.gradient(block.time_s))
        waves = np.exp(1j * np.outer(FREQUENCIES, angle))
        # The wave of a wheel at rest is a constant, which says nothing.
        waves -= waves.mean(axis=1, keepdims=True)
        square = np.maximum(np.sum(np.abs(waves) ** 2, axis=1), 1e-9)
        power += np.abs(waves @ residual[part]) ** 2 / square
    best = np.argsort(-power, kind="stable")[:most]
    return tuple(FREQUENCIES[i] for i in best)


def _neutral(model: Model, name: str) -> bool:
    return CATALOGUE[name].is_neutral(model.effects[name], model)


def _turned(model: Model, names: Sequence[str], phase_deg: float) -> Model:
    turned = {name: {**model.effects[name], PHASE: phase_deg} for name in names}
    return replace(model, effects={**model.effects, **turned})
