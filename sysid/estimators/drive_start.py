"""First guesses of what lies before the law: transport delay, a ceiling on the command, the DC gain.

Each is scanned with variable projection: the best law for every candidate, from one benign start.
"""

from __future__ import annotations

import numpy as np

from sysid.estimators.interface import Options
from sysid.estimators.problem import Problem
from sysid.estimators.projection import Projection, search_poles
from sysid.estimators.stability import free_coordinates

_BENIGN = free_coordinates([0.8, 0.0, 0.0])
_F_LIMIT = 12.0
"""Improvement by one parameter over the residual variance that counts as seen: about 3.5 sigma."""


def drive_start(problem: Problem, options: Options) -> tuple[float, float]:
    """Return a first guess of (delay_s, saturation_rpm); 0 and infinity where not asked for or not seen."""
    limit = _saturation_start(problem) if options.fit_saturation else np.inf
    delay = _delay_start(problem, options.max_delay_s, limit) if options.fit_delay else 0.0
    return delay, limit


def gain_start(problem: Problem, command: np.ndarray) -> float:
    """Return a first guess of steady speed over command: the regression on commands held for 20 ticks."""
    if problem.length <= 20:
        return 1.0
    held = np.zeros(command.shape, bool)
    steady = np.lib.stride_tricks.sliding_window_view(command, 21, axis=1)
    held[:, 20:] = np.ptp(steady, axis=2) == 0.0
    tick = np.clip(problem.tick - 1, 0, problem.length - 1)
    use = held[problem.row, tick]
    x, y, w = command[problem.row, tick][use], problem.speed_rpm[use], problem.weight[use] ** 2
    power = float(np.sum(w * x * x))
    gain = float(np.sum(w * x * y)) / power if power > 0.0 else 1.0
    return gain if abs(gain) > 1e-3 else 1.0


def _cost(problem: Problem, delay_s: float, limit: float) -> float:
    projection = Projection(problem, problem.traces(delay_s, limit))
    return projection.cost(search_poles(projection, _BENIGN)[0])


def _delay_start(problem: Problem, longest_s: float, limit: float) -> float:
    period = problem.sample_period_s

    def best(ticks: range) -> int:
        return min(ticks, key=lambda tick: _cost(problem, tick * period, limit))

    # D, E and F make up for two ticks of delay, so a minimum is seen from three ticks away.
    last = int(longest_s / period + 1e-9)
    coarse = best(range(0, last + 1, 3))
    return period * best(range(max(coarse - 2, 0), min(coarse + 2, last) + 1))


def _saturation_start(problem: Problem) -> float:
    """Scan limits around the fastest speed; infinite unless one explains the data better than none."""
    largest = problem.largest_command
    fastest = float(np.quantile(np.abs(problem.speed_rpm), 0.99))
    limits = [x for x in fastest * np.linspace(0.6, 1.05, 10) if 0.0 < x < largest]
    if not limits:
        return np.inf
    costs = [_cost(problem, 0.0, x) for x in limits]
    # `cost` is a weighted square sum; the residual variance makes the threshold independent of sigma.
    best = int(np.argmin(costs))
    variance = (costs[best] + 2.0 * problem.within_cost) / len(problem.group)
    gained = _cost(problem, 0.0, np.inf) - costs[best]
    return float(limits[best]) if gained > _F_LIMIT * variance else np.inf
