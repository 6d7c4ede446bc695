"""The compared methods, as published, improved and ours: what they reach from random starts, and their costs.

Success from random starts is section 4.1 of the paper, time and memory are its Table 2.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.law.stability import stability_margins
from mecanum_env.statistics import wilson_interval
from mecanum_env.units import FloatArray
from sysid.fit.estimators import (
    SUCCESS_RATIO,
    Estimate,
    Options,
    SearchGrid,
    WheelRun,
    estimate,
    exhaustive,
    random_starts,
)
from sysid.progress import Progress, peak_memory_mib, silent
from sysid.studies.reproduce.data import DataSets
from sysid.studies.reproduce.published import OPTIMAL_COST_RPM2


@dataclass(frozen=True)
class Contender:
    """One method with the experiment's choices for it."""

    name: str
    label: str
    method: str
    published_form: bool = False
    """Six free coefficients, unrefined random starts and a constant learning rate."""
    has_starts: bool = True
    """Whether its result depends on the start."""
    adaptive: bool = False
    """As published except for adaptive step lengths; only used in the study of random starts."""


OURS: Final = "output-error"
CONTENDERS: Final[Mapping[str, Contender]] = {
    contender.name: contender
    for contender in (
        Contender("output-error", "output error", "output-error"),
        Contender("kkt-improved", "kkt, improved start", "kkt"),
        Contender("kkt", "kkt, as published", "kkt", published_form=True),
        Contender("gradient", "gradient, as published", "gradient", published_form=True),
        Contender("poles", "poles, as published", "poles", published_form=True),
        Contender("gradient-adaptive", "gradient, adaptive steps", "gradient", adaptive=True),
        Contender("kkt-adaptive", "kkt, adaptive steps", "kkt", adaptive=True),
        Contender("poles-adaptive", "poles, adaptive steps", "poles", adaptive=True),
        Contender("exhaustive", "exhaustive search", "exhaustive", has_starts=False),
        Contender("one-step", "one step ahead", "one-step", has_starts=False),
    )
}
"""Name -> contender, in the order of every table."""

COMPARED: Final = tuple(name for name, contender in CONTENDERS.items() if not contender.adaptive)
"""Contenders in every table; the others only show the influence of the published step length."""

WITH_STARTS: Final = tuple(name for name, contender in CONTENDERS.items() if contender.has_starts)


@dataclass(frozen=True)
class ExperimentEffort:
    """How much work the experiment does."""

    starts: int = 1000
    """Random starts for the success rates."""
    max_iterations: int = 200
    """As for `Options`; a gradient descent gets 25 iterations for each."""
    search: SearchGrid = field(default_factory=SearchGrid)
    cost_repeats: int = 10
    """Number of timed identifications."""
    exhaustive_repeats: int = 2


QUICK: Final = ExperimentEffort(
    starts=20,
    max_iterations=8,
    search=SearchGrid(
        proportional=(0.0, 5.0, 0.1), integral_per_s=(0.0, 50.0, 1.0), time_constant_s=(0.02, 1.0, 0.01)
    ),
    cost_repeats=2,
    exhaustive_repeats=1,
)
"""Enough to see that everything runs; the results are not those of the experiment."""


def identify(
    runs: list[WheelRun], contender: Contender, effort: ExperimentEffort, seed: int, starts: int
) -> Estimate:
    """Run one method on runs from the first `starts` of the random starts of a seed, which all methods share.

    Raises:
        InputError: no start ended with a finite error.
    """
    if contender.method == "exhaustive":
        return exhaustive(runs, None, effort.search)
    if not contender.has_starts:
        return estimate(runs, contender.method)
    if contender.name == "kkt-improved":
        # The estimator itself refines its kth start from the kth random one.
        return estimate(runs, "kkt", Options(starts=starts, seed=seed, max_iterations=effort.max_iterations))
    return _from(runs, contender, effort, shared_starts(starts, seed))


def identify_from(
    runs: list[WheelRun], contender: Contender, effort: ExperimentEffort, seed: int, index: int
) -> Estimate | None:
    """Run one method on the runs from the shared start `index` of a seed; None if its error becomes infinite.

    The improved kkt chooses its own start.
    """
    if not contender.has_starts or contender.name == "kkt-improved":
        return identify(runs, contender, effort, seed, 1)
    try:
        return _from(runs, contender, effort, shared_starts(index + 1, seed)[index:])
    except InputError:
        return None


def shared_starts(count: int, seed: int) -> tuple[tuple[float, ...], ...]:
    """Return the first `count` random starts A-F of a `seed`; a larger count only adds starts."""
    return tuple(tuple(float(x) for x in row) for row in random_starts(count, seed))


def _from(
    runs: list[WheelRun],
    contender: Contender,
    effort: ExperimentEffort,
    initial: tuple[tuple[float, ...], ...],
) -> Estimate:
    if contender.name == OURS:
        # Third order, as all others: the choice of the order is not part of the comparison.
        return estimate(runs, OURS, Options(initial=initial, order="third"))
    options = Options(
        initial=initial,
        first_starts="random" if contender.published_form else "informed",
        unit_gain=False,
        max_iterations=effort.max_iterations,
    )
    return estimate(runs, contender.method, options)


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
    """Count the outcomes of all starts of a method, given by its name.

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


_ORDER_CHOSEN = "output-error, order chosen"
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
            costs[_ORDER_CHOSEN] = _cost(
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
