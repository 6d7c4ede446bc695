"""The compared methods: as published, improved, and ours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from mecanum_env.errors import InputError
from sysid.fit.estimators import (
    Estimate,
    Options,
    SearchGrid,
    WheelRun,
    estimate,
    exhaustive,
    random_starts,
)


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
    workers: int = 2


QUICK: Final = ExperimentEffort(
    starts=20,
    max_iterations=8,
    search=SearchGrid(
        proportional=(0.0, 5.0, 0.1), integral_per_s=(0.0, 50.0, 1.0), time_constant_s=(0.02, 1.0, 0.01)
    ),
    cost_repeats=2,
    exhaustive_repeats=1,
    workers=1,
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
