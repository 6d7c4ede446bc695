"""Effects that follow the wheel's angle: the angle at which a run starts is unknown, and so is each phase.

To first order a phase p changes a residual by a cos p + b sin p. The likelihood of a run is its mean over all
phases. In the mean of n repeats with a phase each, cos p and sin p are about normal with mean 0 and variance
1 / (2 n); its residual then has the covariance I + Z Z', Z the two columns a and b times that standard
deviation. A wheel that begins every repeat at one angle, since it was homed or simulated, shows no wave in
what its repeats differ by: their mean is then like a run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.stats import f as f_distribution

from mecanum_env.effects import CATALOGUE
from mecanum_env.model import Model
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.compare.measured import Block
from sysid.compare.model_error import Marginal
from sysid.compare.predicted import SimulationSettings, predict
from sysid.logs import Run

PHASE: Final = "phase_deg"
_SPEED: Final = "speed_rpm"
_PHASES_DEG: Final = (0.0, 120.0, 240.0)
"""Three phases give mean, sine and cosine of a response, free of its second harmonic in the mean."""
_VARIANCE: Final = 0.5
_LONGEST_PERIOD_S: Final = 0.5
"""Longest time over which the wheel's angle is averaged [s]: slower ripples turn by little in it. Assumed."""
_ANGLES: Final = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
_CIRCLE: Final = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])
_WAVE_LEVEL: Final = 0.99
"""Level of the F test that repeats differ by a wave. Assumed."""
FREQUENCIES: Final = tuple(range(1, 25))
"""Periods per turn that are looked for: a wheel, gear or disk is uneven a whole number of times."""


def with_unknown_phases(
    predictions_of: Callable[[Model], Sequence[FloatArray] | None],
    whiten: Callable[[Sequence[FloatArray]], FloatArray],
    measured: FloatArray,
    model: Model,
    blocks: Sequence[Block],
    rows: Sequence[slice],
) -> FloatArray | None:
    """Return the whitened residual (N,) of a model whose phases are unknown in each of the `blocks`.

    The square of the result is minus twice the logarithm of the likelihood, up to a constant: what the
    unknown phases cost is spread over the residual as a factor.

    Args:
        predictions_of: the prediction of each block, (m,), by a model with its phases as they are; None if it
            cannot be simulated.
        whiten: whitens one (m,), or columns (m, p), for each block.
        measured: what was measured, whitened, (N,).
        model: the model.
        blocks: what was measured.
        rows: those of each block.
    """
    turning = [name for name in model.effects if CATALOGUE[name].follows_angle and not _neutral(model, name)]
    if not turning:
        alone = predictions_of(model)
        return None if alone is None else measured - whiten(alone)
    found = [predictions_of(_turned(model, turning, phase)) for phase in _PHASES_DEG]
    known = [one for one in found if one is not None]
    if len(known) < len(found):
        return None
    circle = _circle()
    of_blocks = [np.stack(parts) for parts in zip(*known, strict=True)]
    means = [parts.mean(axis=0) for parts in of_blocks]
    per_turn = {model.effects[name]["per_turn"] for name in turning}
    turns = next(iter(per_turn)) if len(per_turn) == 1 else 0.0
    both = [(circle @ parts).T for parts in of_blocks]
    rest, waves = measured - whiten(means), -whiten(both)
    alike = all(_repeats_begin_alike(blocks, one) for one in per_turn)
    # Each block at its likeliest phase; the mean of repeats that differ in theirs without the effect.
    likely = [
        mean + (wave @ _likeliest(rest[part], waves[part]) if block.repeats == 1 or alike else 0.0)
        for block, part, mean, wave in zip(blocks, rows, means, both, strict=True)
    ]
    both = [
        _at_measured_angle(block, speed, wave, turns)
        for block, speed, wave in zip(blocks, likely, both, strict=True)
    ]
    result, waves = rest, -whiten(both)
    for block, part in zip(blocks, rows, strict=True):
        over = _over_one_phase if block.repeats == 1 or alike else _over_mean_phases
        own, deviance = over(result[part], waves[part], block.repeats)
        square = float(own @ own)
        result[part] = own * math.sqrt(deviance / square) if square > 0.0 else own
    return result


def _repeats_begin_alike(blocks: Sequence[Block], per_turn: float) -> bool:
    """Return whether what repeats differ by shows no wave with `per_turn` periods in a turn of the wheel."""
    along, whole, waves, degrees = 0.0, 0.0, 0, 0
    for block in blocks:
        if block.repeats < 2 or not block.channel.startswith("speed_") or block.time_s.size < 2:
            continue
        time_s = block.sample_times_s
        speed = np.interp(time_s, block.time_s, block.value) * RAD_S_PER_RPM
        angle = per_turn * cumulative_trapezoid(speed, time_s, initial=0.0)
        # In proportion to the speed, as an uneven encoder's, or constant, about as a ripple's.
        wave = np.stack([shape * of(angle) for shape in (speed, 1.0) for of in (np.cos, np.sin)], axis=1)
        directions = np.linalg.svd(wave - wave.mean(axis=0), full_matrices=False)[0]
        apart = np.nan_to_num(block.deviations)
        along += float(np.sum((apart @ directions) ** 2))
        whole += float(np.sum(apart**2))
        waves += (block.repeats - 1) * directions.shape[1]
        degrees += block.degrees_of_freedom
    if waves == 0 or degrees <= waves or whole <= along:
        return False
    ratio = (along / waves) / ((whole - along) / (degrees - waves))
    return bool(ratio < f_distribution.ppf(_WAVE_LEVEL, waves, degrees - waves))


def _likeliest(rest: FloatArray, waves: FloatArray) -> FloatArray:
    """Return cosine and sine of the phase that leaves least of a residual (n,) beside waves (n, 2)."""
    along, gram = waves.T @ rest, waves.T @ waves
    squares = 2.0 * along @ _CIRCLE + np.sum(_CIRCLE * (gram @ _CIRCLE), axis=0)
    return np.asarray(_CIRCLE[:, int(np.argmin(squares))])


def _at_measured_angle(block: Block, predicted: FloatArray, waves: FloatArray, per_turn: float) -> FloatArray:
    """Return the cosine and sine of a response, (m, 2), at the angles that the wheel has turned through.

    The waves are simulated at the angles of the prediction, whose error adds up: behind a change of speed
    that is predicted a little wrong, a ripple of several periods per turn is soon out of phase. The measured
    speed tells the angle. Its mean over one period is taken, since the ripple itself swings the wheel, which
    the `predicted` speed knows but roughly.
    """
    time_s = block.time_s
    if not block.channel.startswith("speed_") or time_s.size < 2 or per_turn <= 0.0:
        return waves
    ahead = cumulative_trapezoid(block.value - predicted, time_s, initial=0.0) * RAD_S_PER_RPM
    whole = cumulative_trapezoid(ahead, time_s, initial=0.0)
    turns_s = per_turn * np.abs(predicted) * RAD_S_PER_RPM / (2.0 * math.pi)
    half = 0.5 / np.maximum(turns_s, 1.0 / _LONGEST_PERIOD_S)
    ends = np.clip(np.stack([time_s - half, time_s + half]), time_s[0], time_s[-1])
    slow = np.diff(np.interp(ends, time_s, whole), axis=0)[0] / np.diff(ends, axis=0)[0]
    cos, sin = np.cos(per_turn * slow), np.sin(per_turn * slow)
    a, b = waves.T
    return np.stack([a * cos + b * sin, b * cos - a * sin], axis=1)


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
    marginal = Marginal(waves * math.sqrt(_VARIANCE / repeats))
    own = marginal.of(mean)
    return own, float(own @ own) + 2.0 * float(np.sum(np.log(marginal.spread)))


def at_likeliest_phase(model: Model, run: Run, settings: SimulationSettings) -> Model:
    """Return a model whose effects that follow the wheel's angle have the phase that leaves least of a run.

    The angle at which the wheel starts is known for none. The run is one of a wheel on the bench, else the
    model is returned as it is.
    """
    turning = [name for name in model.effects if CATALOGUE[name].follows_angle and not _neutral(model, name)]
    measured = run.channels.get(_SPEED)
    if not turning or measured is None:
        return model
    found = [predict(_turned(model, turning, at), run, settings=settings)[_SPEED] for at in _PHASES_DEG]
    parts, seen = np.stack(found), np.isfinite(measured)
    cosine, sine = _circle() @ parts
    waves = -np.stack([cosine, sine], axis=1)[seen]
    cos, sin = _likeliest((measured - parts.mean(axis=0))[seen], waves)
    return _turned(model, turning, math.degrees(math.atan2(sin, cos)))


def _circle() -> FloatArray:
    """Return what makes cosine and sine of a response at `_PHASES_DEG`, (2, 3)."""
    at = np.radians(_PHASES_DEG)
    return np.asarray(2.0 / len(at) * np.stack([np.cos(at), np.sin(at)]))


def likely_frequencies(
    residual: FloatArray, blocks: Sequence[Block], rows: Sequence[slice], most: int
) -> tuple[int, ...]:
    """Return the periods per turn, `most` of them, of which a whitened residual (N,) has most.

    Each of the `blocks` has its own phase, and the `rows` of it are known. The angle follows from their
    speeds [rpm].
    """
    power = np.zeros(len(FREQUENCIES))
    for block, part in zip(blocks, rows, strict=True):
        if not block.channel.startswith("speed_") or block.time_s.size < 3:
            continue
        angle = np.cumsum(block.value * RAD_S_PER_RPM * np.gradient(block.time_s))
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
