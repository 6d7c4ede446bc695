"""Residual tests: whether the residuals are white, and whether they still depend on the command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import chi2, norm
from scipy.stats import f as fisher

from mecanum_env.units import FloatArray
from sysid.fit.estimators.interface import Estimate, WheelRun
from sysid.fit.statistics.identifiability import Linearised, linearise

_RANK_TOLERANCE: Final = 1e-9


@dataclass(frozen=True, eq=False)
class CorrelationTest:
    """A test that takes all lags 1..L together."""

    correlation: FloatArray
    """Correlation at each lag, shape (L,)."""
    bound: float
    """Two-sided bound of a single lag at the test's level."""
    statistic: float
    p_value: float
    level: float

    @property
    def passed(self) -> bool:
        """Whether the test found nothing that the law misses."""
        return self.p_value > self.level


@dataclass(frozen=True, eq=False)
class ResidualTests:
    """Tests of the residuals of a law."""

    whiteness: CorrelationTest
    """Ljung-Box test: autocorrelation of the residuals, by lag in samples."""
    input_correlation: CorrelationTest
    """F test: correlation [standard deviations] with the command's change, by lag in ticks."""

    @property
    def passed(self) -> bool:
        """Whether neither test found anything that the law misses."""
        return self.whiteness.passed and self.input_correlation.passed


def residual_tests(
    runs: Sequence[WheelRun], estimate: Estimate, *, lags: int = 30, level: float = 0.01, fitted: bool = True
) -> ResidualTests:
    """Test the residuals of a law.

    With very many samples both tests detect differences too small to matter: look at the correlations, too.

    Args:
        runs: the runs that the estimate was fitted to, or held-out runs.
        estimate: result of any method.
        lags: largest lag of the tests [samples or ticks].
        level: probability that a correct law fails.
        fitted: False for held-out runs or another method's law, where the fit has removed none of the misfit.

    Raises:
        InputError: data without excitation.
        UnstableLawError: the law is unstable.
    """
    at = linearise(runs, estimate)
    predicted = at.problem.predict(estimate.coefficients, at.traces)[at.problem.group]
    return ResidualTests(
        _whiteness(runs, predicted, lags, level), _input_correlation(at, lags, level, fitted)
    )


def _whiteness(runs: Sequence[WheelRun], predicted: FloatArray, lags: int, level: float) -> CorrelationTest:
    """G. M. Ljung and G. E. P. Box, Biometrika 65 (1978), pooled over runs; gaps are not lags."""
    products, counts, power, samples = np.zeros(lags), np.zeros(lags), 0.0, 0
    parts = np.split(predicted, np.cumsum([len(run.speed_rpm) for run in runs])[:-1])
    for run, expected in zip(runs, parts, strict=True):
        order = np.argsort(run.sample_tick, kind="stable")
        residual = ((run.speed_rpm - expected) / run.sigma_rpm)[order]
        time = run.sample_tick[order]
        usual = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
        power += float(residual @ residual)
        samples += len(residual)
        for lag in range(1, min(lags, len(residual) - 1) + 1):
            near = time[lag:] - time[:-lag] < (lag + 0.5) * usual + 1e-9
            products[lag - 1] += float(np.sum((residual[lag:] * residual[:-lag])[near]))
            counts[lag - 1] += int(np.sum(near))
    used = counts > 0
    if power <= 0.0 or not np.any(used):
        return CorrelationTest(np.zeros(lags), np.inf, 0.0, 1.0, level)
    # For white residuals, each lag's mean product over the mean square times sqrt(pairs) is standard normal.
    correlation = np.where(used, products / np.maximum(counts, 1.0), 0.0) / (power / samples)
    statistic = float(np.sum(counts * correlation**2))
    p_value = float(chi2.sf(statistic, int(np.sum(used))))
    bound = float(norm.isf(level / 2.0) / np.sqrt(np.max(counts)))
    return CorrelationTest(correlation, bound, statistic, p_value, level)


def _input_correlation(at: Linearised, lags: int, level: float, fitted: bool) -> CorrelationTest:
    """F test of the residuals regressed on the command changes of the last `lags` ticks, plain and by size.

    The regressors are changes, since a held command correlates with itself at every lag. What the fit has
    already removed (the columns of J) is removed from them, too, so that the level is correct.
    """
    problem = at.problem
    before = at.traces.command_rpm[:, :1] * 0.0 + problem.initial_rpm[:, None]
    change = np.diff(np.concatenate([before, at.traces.command_rpm], axis=1), axis=1)
    padded = np.concatenate([np.zeros((len(change), lags)), change], axis=1)
    stride = padded.shape[1]
    # A sample at tick k + x, 0 < x <= 1, is the first to feel the change at tick k: lag 1.
    newest = np.ceil(problem.tick + problem.fraction - 1e-9).astype(np.intp) - 1
    index = problem.row * stride + lags + newest
    columns = np.stack([padded.ravel()[np.maximum(index - lag, 0)] for lag in range(lags)], axis=1)
    columns[newest < 0] = 0.0
    # change * |change| shows responses whose shape depends on the step's size, such as acceleration limits.
    largest = max(float(np.max(np.abs(change))), 1e-300)
    regressors = np.hstack([columns, columns * np.abs(columns) / largest]) * problem.weight[:, None]
    outside = regressors - at.basis @ (at.basis.T @ regressors) if fitted else regressors
    scale = np.linalg.norm(outside, axis=0)
    raw = np.linalg.norm(regressors, axis=0)
    usable = scale > _RANK_TOLERANCE * np.max(raw, initial=1e-300)
    freedom = at.samples - (at.rank if fitted else 0)
    noise = np.sqrt(at.sum_of_squares / freedom) if freedom > 0 else 0.0
    bound = float(norm.isf(level / 2.0))
    if noise <= 0.0 or not np.any(usable):
        return CorrelationTest(np.zeros(lags), bound, 0.0, 1.0, level)
    correlation = np.zeros(2 * lags)
    correlation[usable] = (outside.T @ at.residual)[usable] / (scale[usable] * noise)
    left, singular, _ = np.linalg.svd(outside[:, usable] / scale[usable], full_matrices=False)
    basis = left[:, singular > _RANK_TOLERANCE * singular[0]]
    explained = float(np.sum((basis.T @ at.residual) ** 2))
    rank, rest = basis.shape[1], freedom - basis.shape[1]
    left_over = at.sum_of_squares - explained
    if rest <= 0 or left_over <= 0.0:
        return CorrelationTest(correlation[:lags], bound, 0.0, 1.0, level)
    statistic = explained / rank / (left_over / rest)
    p_value = float(fisher.sf(statistic, rank, rest))
    return CorrelationTest(correlation[:lags], bound, statistic, p_value, level)
