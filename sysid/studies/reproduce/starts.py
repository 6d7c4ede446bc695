"""How often a method gets there from random starts: success, usable and stable shares with intervals.

Time and peak memory of each method, measured in one run (Table 2).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.law.coefficients import stability_margins
from mecanum_env.units import FloatArray
from sysid.fit.estimators import SUCCESS_RATIO, Estimate, Options, estimate
from sysid.progress import Progress, peak_memory_mib, silent
from sysid.studies.reproduce.contenders import COMPARED, CONTENDERS, OURS, ExperimentEffort, identify_from
from sysid.studies.reproduce.data import DataSets
from sysid.studies.reproduce.published import OPTIMAL_COST_RPM2

USABLE_RMS_RPM: Final = math.sqrt(OPTIMAL_COST_RPM2)
"""Usable: as near to the fitted data as the paper's own optimum, whose H is 21.80 rpm^2."""
_NORMAL_95: Final = 1.959963984540054


@dataclass(frozen=True)
class Rate:
    """A share of trials with its 95 % Wilson interval."""

    count: int
    of: int
    low: float
    high: float

    @property
    def share(self) -> float:
        """The share itself."""
        return self.count / self.of


@dataclass(frozen=True, eq=False)
class StartRates:
    """Where all starts of one method led."""

    method: str
    starts: int
    success: Rate
    """rms within 5 % of the best rms that any method reached with a stable law; stable or not."""
    usable: Rate
    """rms at most `USABLE_RMS_RPM`; stable or not."""
    stable: Rate
    success_and_stable: Rate
    usable_and_stable: Rate
    unstable_starts: Rate
    """Starting points that were unstable laws."""
    diverged: Rate
    """Ended with an rms above the largest command: worse than a wheel that stands still."""
    out_of_iterations: Rate
    """Still descending at the limit of iterations."""
    rms_rpm: FloatArray
    """Of every start, sorted, infinite where it diverged, shape (starts,)."""


def wilson(count: int, of: int) -> Rate:
    """Return `count` out of `of` with its 95 % interval (E. B. Wilson, J. Am. Stat. Assoc. 22, 1927)."""
    z2 = _NORMAL_95**2
    share = count / of
    middle = (share + z2 / (2 * of)) / (1 + z2 / of)
    half = _NORMAL_95 * math.sqrt(share * (1 - share) / of + z2 / (4 * of * of)) / (1 + z2 / of)
    # At 0 and at all the bound is exact; rounding must not put it beside the share.
    low = 0.0 if count == 0 else middle - half
    return Rate(count, of, low, 1.0 if count == of else middle + half)


def best_rms(estimates: list[Estimate]) -> float:
    """Return the lowest rms [rpm] of a stable law among all starts of all estimates."""
    return min(start.rms_rpm for found in estimates for start in found.starts if start.stable)


def start_rates(name: str, found: Estimate, best_rms_rpm: float, largest_rpm: float) -> StartRates:
    """Count where the starts led.

    Args:
        name: of the contender.
        found: its estimate.
        best_rms_rpm: what success is measured against.
        largest_rpm: largest command of the data, beyond which a result counts as diverged.
    """
    starts = found.starts
    rms = np.array([start.rms_rpm for start in starts])
    stable = np.array([start.stable for start in starts])
    success, usable = rms <= SUCCESS_RATIO * best_rms_rpm, rms <= USABLE_RMS_RPM
    initial = np.array([start.initial[:3] for start in starts])

    def rate(which: npt.ArrayLike) -> Rate:
        return wilson(int(np.count_nonzero(np.asarray(which, bool))), len(starts))

    return StartRates(
        method=name,
        starts=len(starts),
        success=rate(success),
        usable=rate(usable),
        stable=rate(stable),
        success_and_stable=rate(success & stable),
        usable_and_stable=rate(usable & stable),
        unstable_starts=rate(np.any(stability_margins(initial) <= 0.0, axis=1)),
        diverged=rate(~(rms <= largest_rpm)),
        out_of_iterations=rate([not s.converged and s.rms_rpm <= largest_rpm for s in starts]),
        rms_rpm=np.sort(rms),
    )


ORDER_CHOSEN = "output-error, order chosen"
"""Output error as `sysid.fit` runs it: from its own start, with the choice of order that no other makes."""


@dataclass(frozen=True)
class Cost:
    """What one identification costs: one start, from the runs to the law."""

    label: str
    repeats: int
    mean_s: float
    """Processor time: other programs on the machine do not count."""
    median_s: float
    longest_s: float
    mean_wall_s: float
    diverged: int
    """Repeats that ended without a finite error, at once."""
    mean_iterations: float
    """Of the others."""
    peak_memory_mib: float
    """Of Python objects and arrays, in a further call that is not timed."""


def measure_costs(
    data: DataSets, effort: ExperimentEffort, seed: int, progress: Progress = silent
) -> dict[str, Cost]:
    """Time every method on the same recordings, one after the other in this process.

    Args:
        data: the recordings.
        effort: repeats, iterations and ranges.
        seed: of the starts; repeat k takes the kth, as all methods do.
        progress: called with the name of each method.
    """
    costs = {}
    for name in COMPARED:
        progress(name)
        contender = CONTENDERS[name]
        runs = data.runs_for(contender.method)
        long = contender.method == "exhaustive"
        costs[name] = _cost(
            contender.label,
            partial(identify_from, runs, contender, effort, seed),
            effort.exhaustive_repeats if long else effort.cost_repeats,
        )
        if name == OURS:
            costs[ORDER_CHOSEN] = _cost(
                "output error, order chosen",
                lambda _: estimate(data.fit_runs, OURS, Options(starts=1)),
                effort.cost_repeats,
            )
    return costs


def _cost(label: str, work: Callable[[int], Estimate | None], repeats: int) -> Cost:
    memory = peak_memory_mib(lambda: work(0))  # first: what the first call loads is no cost of the method
    done, processor, wall = [], [], []
    for index in range(repeats):
        began, began_wall = time.process_time(), time.perf_counter()
        done.append(work(index))
        processor.append(time.process_time() - began)
        wall.append(time.perf_counter() - began_wall)
    iterations = [found.starts[0].iterations for found in done if found is not None]
    return Cost(
        label=label,
        repeats=repeats,
        mean_s=float(np.mean(processor)),
        median_s=float(np.median(processor)),
        longest_s=float(np.max(processor)),
        mean_wall_s=float(np.mean(wall)),
        diverged=repeats - len(iterations),
        mean_iterations=float(np.mean(iterations)) if iterations else 0.0,
        peak_memory_mib=memory,
    )
