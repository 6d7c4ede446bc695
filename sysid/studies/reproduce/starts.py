"""What a method reaches from random starts (section 4.1), and what it costs in time and memory (Table 2)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.law.stability import stability_margins
from mecanum_env.statistics import wilson_interval
from mecanum_env.units import FloatArray
from sysid.fit.estimators import SUCCESS_RATIO, Estimate, Options, estimate
from sysid.progress import Progress, peak_memory_mib, silent
from sysid.studies.reproduce.contenders import COMPARED, CONTENDERS, OURS, ExperimentEffort, identify_from
from sysid.studies.reproduce.data import DataSets
from sysid.studies.reproduce.published import OPTIMAL_COST_RPM2

USABLE_RMS_RPM: Final = math.sqrt(OPTIMAL_COST_RPM2)
"""Largest rms that counts as usable: that of the paper's own optimum, H = 21.80 rpm^2."""


@dataclass(frozen=True)
class Rate:
    """A share of trials with its 95 % Wilson interval."""

    count: int
    of: int
    low: float
    high: float

    @property
    def share(self) -> float:
        """Share of the trials that count."""
        return self.count / self.of


@dataclass(frozen=True, eq=False)
class StartRates:
    """The outcomes of all starts of one method."""

    method: str
    starts: int
    success: Rate
    """The rms is within 5 % of the best rms of any stable law; the law may be unstable."""
    usable: Rate
    """The rms is at most `USABLE_RMS_RPM`; the law may be unstable."""
    stable: Rate
    success_and_stable: Rate
    usable_and_stable: Rate
    unstable_starts: Rate
    """Starting points that are unstable laws."""
    diverged: Rate
    """Ended with an rms above the largest command: worse than predicting a wheel at rest."""
    out_of_iterations: Rate
    """Still descending when the iterations were used up."""
    rms_rpm: FloatArray
    """Sorted rms of all starts, infinite for those that diverged, shape (starts,)."""


def best_rms(estimates: list[Estimate]) -> float:
    """Return the lowest rms [rpm] of a stable law among all starts of all estimates."""
    return min(start.rms_rpm for found in estimates for start in found.starts if start.stable)


def start_rates(name: str, found: Estimate, best_rms_rpm: float, largest_rpm: float) -> StartRates:
    """Count the outcomes of all starts of the method of a name.

    Success is measured against `best_rms_rpm`; an rms above the largest command, `largest_rpm`, counts as
    diverged.
    """
    starts = found.starts
    rms = np.array([start.rms_rpm for start in starts])
    stable = np.array([start.stable for start in starts])
    success, usable = rms <= SUCCESS_RATIO * best_rms_rpm, rms <= USABLE_RMS_RPM
    initial = np.array([start.initial[:3] for start in starts])

    def rate(which: npt.ArrayLike) -> Rate:
        count = int(np.count_nonzero(np.asarray(which, bool)))
        return Rate(count, len(starts), *wilson_interval(count, len(starts)))

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
"""Output error as `sysid.fit` runs it: from its own start, including its choice of the law's order."""


@dataclass(frozen=True)
class Cost:
    """Cost of one identification from one start, from the runs to the law."""

    label: str
    repeats: int
    mean_s: float
    """Mean processor time; other programs on the machine do not count."""
    median_s: float
    longest_s: float
    mean_wall_s: float
    diverged: int
    """Repeats that ended early without a finite error."""
    mean_iterations: float
    """Mean iterations of the other repeats."""
    peak_memory_mib: float
    """Peak memory of Python objects and arrays, in a further call that is not timed."""


def measure_costs(
    data: DataSets, effort: ExperimentEffort, seed: int, progress: Progress = silent
) -> dict[str, Cost]:
    """Time every method on the same recordings, one after the other in this process.

    Repeat k of every method takes the kth start of the seed; `progress` is called with each method's name.
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
    memory = peak_memory_mib(lambda: work(0))  # First, since loading modules is no cost of the method.
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
