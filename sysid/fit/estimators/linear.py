"""Linear least squares: one-step-ahead prediction, Steiglitz-McBride, and random stable laws to start from.

The first is the textbook baseline (equation error); all three serve the other methods as starting points.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.linalg import lstsq
from scipy.signal import lfilter

from mecanum_env.law.stability import stabilised_abc
from mecanum_env.units import FloatArray
from sysid.fit.estimators.interface import Estimate, Options, WheelRun
from sysid.fit.estimators.problem import single_estimate, stack


def one_step(runs: Sequence[WheelRun], options: Options | None = None) -> Estimate:
    """Estimate the law by predicting each speed from the three *measured* ones before it.

    Linear least squares needs no starting point and has no local minimum. However, noise in the regressors
    biases it (Ljung, "System Identification", section 7.3), and it may be unstable. Delay and saturation are
    not estimated; of the options only `unit_gain` is used.

    Raises:
        InputError: no usable data (see `problem.require_excitation`).
    """
    options = options or Options()
    began = time.perf_counter()
    problem = stack(runs)
    coefficients = one_step_coefficients(runs, unit_gain=options.unit_gain)
    return single_estimate(problem, coefficients, "one-step", "one-step", options.free_coefficients, 1, began)


def one_step_coefficients(runs: Sequence[WheelRun], *, unit_gain: bool = True) -> FloatArray:
    """Return A-F, shape (6,), that predict w(k+1) best from the *measured* three speeds before it.

    With `unit_gain` the six sum to 1. Samples between ticks are interpolated linearly; ticks after the last
    sample are left out.
    """
    return _solve(*_regression([_on_ticks(run) for run in runs], unit_gain), unit_gain)


def steiglitz_mcbride_coefficients(
    runs: Sequence[WheelRun],
    *,
    unit_gain: bool = True,
    rounds: int = 10,
    filtered_by: npt.ArrayLike | None = None,
) -> FloatArray:
    """Return stable A-F, shape (6,), by repeated one-step least squares on filtered signals.

    K. Steiglitz and L. E. McBride, "A technique for the identification of linear systems", IEEE Trans.
    Automatic Control 10 (1965). A few rounds come close to the free-running optimum, without a derivative.
    Each of at most `rounds` filters with 1/(denominator) of the law before, the first with (A, B, C), shape
    (3,), `filtered_by` or else of the one-step law. With `unit_gain` the six sum to 1.
    """
    series = [_on_ticks(run) for run in runs]
    if filtered_by is None:
        coefficients = _solve(*_regression(series, unit_gain), unit_gain)
    else:
        coefficients = np.concatenate([np.asarray(filtered_by, float), np.zeros(3)])
    coefficients = stable_coefficients(coefficients, unit_gain=unit_gain)
    for _ in range(rounds):
        denominator = np.array([1.0, *(-coefficients[:3])])
        filtered = [tuple(lfilter([1.0], denominator, x) for x in pair) for pair in series]
        last = coefficients
        coefficients = _solve(*_regression(filtered, unit_gain), unit_gain)
        coefficients = stable_coefficients(coefficients, unit_gain=unit_gain)
        if np.max(np.abs(coefficients - last)) < 1e-9:
            break
    return coefficients


def stable_coefficients(coefficients: FloatArray, *, unit_gain: bool) -> FloatArray:
    """Return `coefficients` A-F with unstable poles reflected; with `unit_gain`, E makes the sum 1."""
    result: FloatArray = np.nan_to_num(np.array(coefficients, float), nan=0.0, posinf=0.0, neginf=0.0)
    result[:3] = stabilised_abc(result[:3])
    if unit_gain:
        result[4] = 1.0 - (result[0] + result[1] + result[2] + result[3] + result[5])
    return result


def random_coefficients(rng: np.random.Generator) -> FloatArray:
    """Return a random stable law A-F of unit gain, shape (6,).

    The poles lie in the disc of radius 0.98, half of the laws have a complex pair; D and F lie in -0.5..0.5.
    """
    first, second = rng.uniform(-0.98, 0.98, 2)
    if rng.random() < 0.5:
        size, angle = 0.98 * np.sqrt(rng.random()), rng.uniform(0.0, np.pi)
        poles = np.array([size * np.exp(1j * angle), size * np.exp(-1j * angle), first])
    else:
        poles = np.array([first, second, rng.uniform(-0.98, 0.98)])
    abc = -np.real(np.poly(poles))[1:]
    d, f = rng.uniform(-0.5, 0.5, 2)
    return np.array([*abc, d, 1.0 - np.sum(abc) - d - f, f])


def _on_ticks(run: WheelRun) -> tuple[FloatArray, FloatArray]:
    """Return (speed, command) at every tick as deviations from the start, preceded by three steady ticks."""
    order = np.argsort(run.sample_tick, kind="stable")
    time, speed = run.sample_tick[order], run.speed_rpm[order]
    last = int(np.floor(time[-1]))
    known, past = (np.append(-1.0, time), np.append(run.initial_rpm, speed)), np.zeros(3)
    w = np.interp(np.arange(last + 1), *known) - run.initial_rpm
    command = run.command()[:last] - run.initial_rpm
    return np.concatenate([past, w]), np.concatenate([past, command])


def _regression(series: Sequence[tuple[FloatArray, ...]], unit_gain: bool) -> tuple[FloatArray, FloatArray]:
    """Return the regressors, shape (n, 6), and w(k+1), shape (n,); with `unit_gain`, E is eliminated."""
    rows, targets = [], []
    for w, r in series:
        j = np.arange(3, len(r))  # r[j] = r(k), w[j] = w(k); the first three are the steady past
        rows.append(np.stack([w[j], w[j - 1], w[j - 2], r[j], r[j - 1], r[j - 2]], axis=1))
        targets.append(w[j + 1])
    x, y = np.concatenate(rows), np.concatenate(targets)
    if unit_gain:
        y = y - x[:, 4]
        x = x[:, [0, 1, 2, 3, 5]] - x[:, [4]]
    return x, y


def _solve(x: FloatArray, y: FloatArray, unit_gain: bool) -> FloatArray:
    solution = np.asarray(lstsq(x, y, cond=1e-12)[0])
    if not unit_gain:
        return solution
    a, b, c, d, f = solution
    return np.array([a, b, c, d, 1.0 - (a + b + c + d + f), f])
