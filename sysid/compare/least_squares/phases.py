"""Effects that follow the wheel's angle: the angle at which a run starts is unknown, and so is each phase.

A prediction that errs by some rpm after a change of command is off by a part of a turn from then on. So each
command that is held for long enough may have a phase of its own, where that makes a run far likelier.

To first order a phase p changes a residual by a cos p + b sin p. The likelihood of a run is its mean over all
phases. In the mean of n repeats, cos p and sin p are about normal with mean 0 and variance 1 / (2 n); its
residual then has the covariance I + Z Z', Z the two columns a and b times that standard deviation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from mecanum_env.effects import CATALOGUE
from mecanum_env.model import Model
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.compare.measured import Block, Observations
from sysid.compare.noise import holds_of

PHASE: Final = "phase_deg"
_PHASES_DEG: Final = (0.0, 120.0, 240.0)
"""Three phases give mean, sine and cosine of a response, free of its second harmonic in the mean."""
_VARIANCE: Final = 0.5
_ANGLES: Final = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
_CIRCLE: Final = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])
_FEWEST: Final = 10
"""Fewest values of a held command that have a phase of their own; of shorter ones, several have one. Assumed:
a phase that few values tell is hardly known."""
_FAR_LIKELIER: Final = 0.8
"""Share of the deviance with one phase below which that with a phase for each hold counts. Assumed: a smaller
gain makes up for what the formula of the effect lacks, and shifts its size."""
FREQUENCIES: Final = tuple(range(1, 25))
"""Periods per turn that are looked for: a wheel, gear or disk is uneven a whole number of times."""


@dataclass(frozen=True)
class PhaseParts:
    """The rows of a whitened residual that have a phase of their own, for one block of observations."""

    whole: slice
    """All rows of the block."""
    holds: tuple[slice, ...]
    """Those of each held command, or of several short ones."""
    repeats: int
    """Number of runs whose mean the block is."""


def phase_parts(observations: Observations, rows: Sequence[slice]) -> tuple[PhaseParts, ...]:
    """Return what may have a phase of its own in each block of the observations.

    `rows` are those of each block in a whitened residual.
    """
    found = []
    for block, own in zip(observations.blocks, rows, strict=True):
        starts = np.flatnonzero(np.diff(holds_of(observations, block))) + 1
        edges = [0]
        for start in starts.tolist():
            if min(start - edges[-1], block.value.size - start) >= _FEWEST:
                edges.append(start)
        holds = tuple(slice(own.start + a, own.start + b) for a, b in pairwise([*edges, block.value.size]))
        found.append(PhaseParts(own, holds, block.repeats))
    return tuple(found)


def with_unknown_phases(
    residual_of: Callable[[Model], FloatArray | None], model: Model, parts: Sequence[PhaseParts]
) -> FloatArray | None:
    """Return the whitened residual (N,) of a model whose phases are unknown in each block.

    `residual_of` returns that of a model with its phases as they are, None if it cannot be simulated. The
    square of the result is minus twice the logarithm of the likelihood, up to a constant: what the unknown
    phases cost is spread over the residual as a factor.
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
    for part in parts:
        over = _over_one_phase if part.repeats == 1 else _over_mean_phases
        one, each = (
            np.concatenate([_scaled(*over(result[rows], waves[:, rows].T, part.repeats)) for rows in way])
            for way in ((part.whole,), part.holds)
        )
        result[part.whole] = each if each @ each < _FAR_LIKELIER * (one @ one) else one
    return result


def _scaled(residual: FloatArray, deviance: float) -> FloatArray:
    """Return a residual (n,) with a factor that makes its square a deviance."""
    square = float(residual @ residual)
    return residual * math.sqrt(deviance / square) if square > 0.0 else residual


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
