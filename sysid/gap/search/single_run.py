"""What a single run shows and its repeats do not, such as a command that came late once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from sysid.compare.least_squares import Fitted, ResidualProblem
from sysid.logs import Run


@dataclass(frozen=True, eq=False)
class SingleRun:
    """The run that differs most from its repeats."""

    run: Run
    excess: float
    """Its squared whitened residual beyond that of its repeats."""


def single_run(problem: ResidualProblem, fitted: Fitted[Any]) -> SingleRun | None:
    """Return the run that differs most from its repeats; None if none is beside repeats.

    Runs count alone where their stamps differ, so that their mean is not taken.
    """
    situations = problem.observations.situations
    squares: dict[str, dict[int, list[float]]] = {}
    for block, rows in zip(problem.observations.blocks, problem.whitener.slices, strict=True):
        runs = squares.setdefault(situations[block.situation].group, {})
        runs.setdefault(block.situation, []).extend(fitted.residual[rows] ** 2)
    found = []
    for runs in squares.values():
        *rest, most = sorted(runs, key=lambda index: float(np.mean(runs[index])))
        if rest:
            usual = float(np.mean([value for index in rest for value in runs[index]]))
            excess = float(np.sum(runs[most])) - usual * len(runs[most])
            found.append(SingleRun(situations[most].runs[0], excess))
    return max(found, key=lambda one: one.excess, default=None)
