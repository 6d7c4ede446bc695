"""Exhaustive search for a reduced-order motor under PI control: the method of Nakagawa et al.

Y. Nakagawa, N. Igo and K. Hoshino, "Controlling a Mecanum-wheeled robot with multiple swivel axes controlled
by three commands", Sensors 25(3), 2025, as S. Nie, N. Igo and K. Hoshino describe it (section 1). The motor
without inductance is T dw/dt + w = u, its gain absorbed by the controller; u = Kp e + Ki (integral of e), e =
r - w. With the discretisation of the wheel law (forward difference, incremental PI) and n = T/period it
becomes a wheel law with C = F = 0, whose coefficients sum to 1:

    A = 2 - (1 + Kp + Ki period)/n,   B = -1 + (1 + Kp)/n,   D = (Kp + Ki period)/n,   E = -Kp/n

The parameters form two groups, (Kp, Ki) and T. In turn, one group is held and the other is searched over its
whole grid. Ranges, steps and the first T are prior knowledge, given by `SearchGrid`.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.units import FloatArray
from sysid.fit.estimators.batch import BatchCost, batch_cost
from sysid.fit.estimators.interface import Estimate, Options, WheelRun
from sysid.fit.estimators.problem import single_estimate, stack

_CHUNK: Final = 2000  # number of laws simulated together: small enough for the cache


@dataclass(frozen=True)
class SearchGrid:
    """Ranges and steps of the parameters, the first T and the speed of the data to fit.

    Raises:
        InputError: an empty range, or a value that must be positive and is not.
    """

    proportional: tuple[float, float, float] = (0.0, 10.0, 0.01)
    """Kp: lowest, highest, step."""
    integral_per_s: tuple[float, float, float] = (0.0, 100.0, 0.1)
    """Ki [1/s]: lowest, highest, step."""
    time_constant_s: tuple[float, float, float] = (0.02, 1.0, 0.001)
    """T [s]: lowest, highest, step."""
    first_time_constant_s: float = 0.1
    """T during the first search of (Kp, Ki) [s]."""
    rounds: int = 2
    """How often both groups are searched."""
    speed_rpm: float = 60.0
    """The runs whose largest command is nearest to this are fitted [rpm]."""

    def __post_init__(self) -> None:
        for name in ("proportional", "integral_per_s", "time_constant_s"):
            low, high, step = getattr(self, name)
            if not (0.0 <= low <= high < np.inf and step > 0.0):
                raise InputError(
                    f"search: {name} = ({low:g}, {high:g}, {step:g}), "
                    "must be 0 <= lowest <= highest and a step above 0"
                )
        if self.time_constant_s[0] <= 0.0 or self.first_time_constant_s <= 0.0:
            raise InputError("search: time constants must be above 0")
        if self.rounds < 1:
            raise InputError(f"search: rounds = {self.rounds}, must be at least 1")


def exhaustive(
    runs: Sequence[WheelRun], options: Options | None = None, search: SearchGrid | None = None
) -> Estimate:
    """Estimate the three parameters by alternating exhaustive search on the runs nearest to 60 rpm.

    Those whose largest command is nearest to the speed of the `search` are fitted; the `kind` of the start
    states that speed. The rms is that of all runs. The options are ignored: the structure has unit DC gain.

    Raises:
        InputError: no usable data, or every law of the grid diverges.
    """
    del options
    search = search or SearchGrid()
    began = time.perf_counter()
    problem = stack(runs)
    period = problem.sample_period_s
    used, speed = runs_near(runs, search.speed_rpm)
    cost = batch_cost(stack(used))
    kp = ki = np.nan
    constant = search.first_time_constant_s
    grid = np.meshgrid(_axis(search.proportional), _axis(search.integral_per_s), indexing="ij")
    pairs = np.stack([values.ravel() for values in grid])
    constants = _axis(search.time_constant_s)
    evaluations = search.rounds * (pairs.shape[1] + len(constants))
    best = np.inf
    for _ in range(search.rounds):
        index, best = _lowest(cost, pairs, np.full(pairs.shape[1], constant), period)
        kp, ki = pairs[:, index]
        index, best = _lowest(cost, np.full((2, len(constants)), [[kp], [ki]]), constants, period)
        constant = float(constants[index])
    if not np.isfinite(best):
        raise InputError(
            f"exhaustive: every one of {evaluations} laws diverges at {period:g} s a tick; "
            "widen the ranges of the search"
        )
    law, kind = pi_law(kp, ki, constant, period), f"grid at {speed:g} rpm"
    return single_estimate(problem, law, "exhaustive", kind, ("A", "B", "D"), evaluations, began)


def pi_law(
    proportional: npt.ArrayLike,
    integral_per_s: npt.ArrayLike,
    time_constant_s: npt.ArrayLike,
    period_s: float,
) -> FloatArray:
    """Return A-F, shape (..., 6), of a first-order motor under PI control: proportional and integral gain."""
    kp, ki, n = np.broadcast_arrays(
        np.asarray(proportional, float),
        np.asarray(integral_per_s, float) * period_s,
        np.asarray(time_constant_s, float) / period_s,
    )
    zero = np.zeros_like(n)
    return np.stack(
        [2.0 - (1.0 + kp + ki) / n, -1.0 + (1.0 + kp) / n, zero, (kp + ki) / n, -kp / n, zero], axis=-1
    )


def runs_near(runs: Sequence[WheelRun], speed_rpm: float) -> tuple[list[WheelRun], float]:
    """Return the runs whose largest command is nearest to `speed_rpm` (of two, the faster), and it [rpm]."""
    tops = np.array([float(np.max(np.abs(run.command()))) for run in runs])
    nearest = float(min(tops, key=lambda top: (abs(top - speed_rpm), -top)))
    return [run for run, top in zip(runs, tops, strict=True) if abs(top - nearest) <= 0.5], nearest


def _axis(limits: tuple[float, float, float]) -> FloatArray:
    low, high, step = limits
    return np.asarray(low + step * np.arange(int(np.floor((high - low) / step + 1e-9)) + 1))


def _lowest(cost: BatchCost, gains: FloatArray, constant: FloatArray, period: float) -> tuple[int, float]:
    """Simulate all (Kp, Ki), shape (2, n), with T, shape (n,), and return the index and H of the best."""
    index, best = 0, np.inf
    for first in range(0, len(constant), _CHUNK):
        part = slice(first, first + _CHUNK)
        values = cost.value(pi_law(gains[0, part], gains[1, part], constant[part], period))
        lowest = int(np.argmin(values))
        if values[lowest] < best:
            index, best = first + lowest, float(values[lowest])
    return index, best
