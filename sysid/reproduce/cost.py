"""Time and peak memory of each method, measured in one run (Table 2)."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from sysid.estimators import Estimate, Options, estimate
from sysid.measure import Progress, peak_memory_mib, silent
from sysid.reproduce.contenders import COMPARED, CONTENDERS, OURS, Effort, identify_from
from sysid.reproduce.data import DataSets

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


def measure_costs(data: DataSets, effort: Effort, seed: int, progress: Progress = silent) -> dict[str, Cost]:
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
