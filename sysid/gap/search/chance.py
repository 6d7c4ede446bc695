"""What chance does: the cost that a right model has, and the gain of a needless effect.

A right model leaves noise and, on robots, the scatter of the rollers at the place of the set. The noise
variance is estimated from finitely many samples, so that the ratio of a cost to it follows an F distribution.

If a fitted set is the whole truth, its marginal residual is white, except for the scatter of the rollers.
Drawing such residuals and growing the set by every effect of the library, as the search does, gives the
distribution of the best gain by chance, whatever the number of effects and their likeness. Only the inner
products of the responses are needed: the projections U = C' r on unit columns C are normal with covariance
C' (I + R R') C, where R are the columns of `roller_scatter`.

Noise is seldom normal: an encoder counts in steps, a command comes late now and then. Where a wheel drives
the commands of the fit again, the runs of both logs are exchanged at random (`Exchange`), and what these
draws gain or cost counts where it is more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.stats import f as f_distribution

from mecanum_env.units import FloatArray
from sysid.compare.least_squares import Fitted, ResidualProblem
from sysid.gap.search.responses import Response
from sysid.gap.search.single_run import single_run
from sysid.gap.search.thresholds import THRESHOLDS

_KNOWN: Final = 1e7
"""Degrees of freedom of a variance that is known exactly, as the F distribution takes them."""


@dataclass(frozen=True)
class Floor:
    """What is known of the noise floor."""

    freedom: float
    """Degrees of freedom of the estimated noise variance."""
    trusted: bool
    """Whether it is known what a right model leaves; if not, no set can be called inadequate."""
    compared: bool = False
    """Whether the model's own error is from a comparison with the logs of its fit."""
    knows_all: bool = False
    """Whether what every effect would do is among that error, as far as the logs of the fit leave it open."""
    repeatable: bool = True
    """Whether repeats differ by no more than noise; if not, something random acts on the wheel."""
    false_alarm: float = THRESHOLDS.false_alarm
    """Probability with which noise alone may be taken for an effect, after earlier studies of these logs."""
    familiar: bool = False
    """Whether the logs of the fit hold the commands of these logs, too."""
    calibrated: bool = False
    """Whether repeats of these commands in the logs of the fit show what chance does, and what varies."""
    slack: float = 1.0
    """Factor by which a right model's cost may be larger than was measured in other commands."""
    independent: float = math.inf
    """Most degrees of freedom of a right model's cost: fewer than its values where the command sequences of a
    robot differ in their noise. Only in the commands of the fit do they excuse what a set leaves."""
    lasting: bool = False
    """Whether the noise holds what lasts for a hold, which was measured beside the best set in these very
    logs: it then holds whatever no set explains, too."""

    @property
    def least_share(self) -> float:
        """Share of a right model's cost by which each effect must lower one that is not plainly visible."""
        return THRESHOLDS.least_on_bench if self.new_on_bench else 0.0

    @property
    def new_on_bench(self) -> bool:
        """Whether a drive's own error is known from the logs of its fit, in other commands than these."""
        return self.compared and not (self.knows_all or self.familiar)

    def largest_ratio(self, size: int) -> float:
        """Return the cost over `size` values that a right model exceeds in a false alarm."""
        known = min(self.freedom, _KNOWN)
        values = min(size, self.independent) if self.familiar else size
        return self.slack * float(f_distribution.isf(self.false_alarm, values, known))

    def chance(self, ratio: float, size: int) -> float:
        """Return the probability that a right model's cost over `size` values is at least a `ratio`."""
        known = min(self.freedom, self.independent, _KNOWN)
        return float(f_distribution.sf(ratio / self.slack, min(size, self.independent), known))


def roller_scatter(problem: ResidualProblem, fitted: Fitted[Any]) -> FloatArray:
    """Return the columns of the rollers' scatter at the place of a set, (N, k), each one sigma."""
    return problem.roller_scatter(fitted.candidate.model(problem.base, fitted.place))


def expected(problem: ResidualProblem, *fitted: Fitted[Any]) -> float:
    """Return the cost that a right model has, with the largest roller scatter of some fitted sets."""
    return problem.size + max(float(np.sum(roller_scatter(problem, one) ** 2)) for one in fitted)


def misfit(problem: ResidualProblem, fitted: Fitted[Any], floor: Floor) -> float:
    """Return the probability that a right model has at least the cost of a set; 1 if nobody can tell."""
    if not floor.trusted:
        return 1.0
    normal = floor.chance(
        (fitted.cost - _of_one_run(problem, fitted)) / expected(problem, fitted), problem.size
    )
    if normal > floor.false_alarm:
        return normal
    costs = exchanged_costs(problem, fitted, floor.false_alarm)
    return max(normal, _share_above(costs, fitted.cost)) if costs.size else normal


def odd_run(problem: ResidualProblem, fitted: Fitted[Any], floor: Floor) -> str:
    """Return the file of the run without which the cost of a set is no more than chance allows.

    It is empty if there is none, or if chance allows the cost as it is.
    """
    odd = single_run(problem, fitted) if problem.unchanged.size else None
    whole = floor.chance(fitted.cost / expected(problem, fitted), problem.size)
    if odd is None or not whole <= floor.false_alarm < misfit(problem, fitted, floor):
        return ""
    return odd.run.file


def _of_one_run(problem: ResidualProblem, fitted: Fitted[Any]) -> float:
    """Return the cost that a single run shows and its repeats do not, where the noise of repeats is known.

    It is left out of one command sequence only, the one where it is most: what happens in several is a
    difference, if a random one.
    """
    odd = single_run(problem, fitted) if problem.unchanged.size else None
    return 0.0 if odd is None else odd.excess


def complete(problem: ResidualProblem, fitted: Fitted[Any], floor: Floor) -> bool:
    """Return whether a set leaves no more than a right model would, but for a single odd run."""
    ratio = floor.largest_ratio(problem.size)
    if not floor.trusted or fitted.cost <= problem.size * ratio:
        # The scatter, which takes simulations, could only add to what is allowed.
        return floor.trusted
    if fitted.cost - _of_one_run(problem, fitted) <= expected(problem, fitted) * ratio:
        return True
    return fitted.cost <= _by_exchange(problem, fitted, floor)


def exchanged_costs(problem: ResidualProblem, fitted: Fitted[Any], false_alarm: float) -> FloatArray:
    """Return sorted costs that a set would have, if it is the truth, by exchanges with the runs of the fit.

    It is empty where these runs cannot be exchanged often enough for a `false_alarm` of that probability, or
    where a new run differs from its repeats as none of the fit does.
    """
    exchange = problem.exchange
    if exchange is None or not _is_exchangeable(problem, false_alarm) or not exchange.alike:
        return np.zeros(0)
    nothing = np.zeros((problem.size, 0))
    return np.sort(
        exchange.drawn(np.random.default_rng(_SEED), _draws(false_alarm), fitted.residual, nothing)[1]
    )


def _by_exchange(problem: ResidualProblem, fitted: Fitted[Any], floor: Floor) -> float:
    """Return the cost that a right model exceeds in a false alarm, by exchanged runs; 0 without them."""
    costs = exchanged_costs(problem, fitted, floor.false_alarm)
    return float(np.quantile(costs, 1.0 - floor.false_alarm)) if costs.size else 0.0


def _is_exchangeable(problem: ResidualProblem, false_alarm: float) -> bool:
    """Return whether the true labelling is so rare among all that it is no false alarm by itself."""
    return problem.exchange is not None and problem.exchange.labellings * false_alarm >= _RARE


def _draws(false_alarm: float) -> int:
    """Return how many draws tell what is exceeded in a `false_alarm` of that probability."""
    return math.ceil(THRESHOLDS.draws * max(1.0, min(THRESHOLDS.false_alarm / false_alarm, _MOST_DRAWS)))


def _share_above(drawn: FloatArray, value: float) -> float:
    """Return the probability of at least a `value` among those that were `drawn`, sorted."""
    return (drawn.size - int(np.searchsorted(drawn, value, side="left")) + 1.0) / (drawn.size + 1.0)


def enough(
    problem: ResidualProblem, base: Fitted[Any], fitted: Fitted[Any], floor: Floor, right: float | None = None
) -> bool:
    """Return whether a set leaves what a right model would, or little beside what the set explains.

    What a single run shows and its repeats do not is left out, as in `misfit`. `right` is the cost of a right
    model, by default measured at the place of the set.
    """
    if not floor.trusted:
        return True
    right = expected(problem, fitted) if right is None else right
    allowed = right * floor.largest_ratio(problem.size)
    left = fitted.cost - _of_one_run(problem, fitted)
    explained = float(np.sum((base.residual - fitted.residual) ** 2))
    share = THRESHOLDS.adequate_residual**2 / max(1, len(fitted.names))
    if left <= allowed + share * explained:
        return True
    return left <= _by_exchange(problem, fitted, floor) + share * explained


_MOST_DRAWS: Final = 32.0
"""Largest number of draws in those of a first study: enough for six studies of the same logs."""
_RARE: Final = 10.0
"""Labellings of exchanged runs for each that a false alarm may have, from which exchanges tell what chance
does: the true one and those near it are then a small part of them. Assumed."""
_SEED: Final = 0
"""Of the exchanges that tell what cost a right model has."""


@dataclass(frozen=True)
class ChanceGains:
    """The best gain by chance, simulated many times."""

    gains: FloatArray
    """Fall of the cost in each draw, sorted."""
    false_alarm: float = THRESHOLDS.false_alarm
    """Probability of a false alarm."""
    scale: float = 1.0
    """Factor from these gains to those that logs in which nothing changed show, at least 1."""

    def threshold(self) -> float:
        """Return the gain that is exceeded by chance with the probability of a false alarm."""
        return self.scale * float(np.quantile(self.gains, 1.0 - self.false_alarm))

    def p_value(self, gain: float) -> float:
        """Return the probability of at least this `gain` by chance."""
        return _share_above(self.gains, gain / self.scale)


def chance_gains(
    problem: ResidualProblem,
    fitted: Fitted[Any],
    library: Sequence[Response],
    rng: np.random.Generator,
    false_alarm: float = THRESHOLDS.false_alarm,
    count: float | None = None,
) -> ChanceGains:
    """Simulate the best gain of a fitted set by one more effect, if the set is the truth.

    `library` holds the responses of the effects that were considered. For rarer false alarms than usual there
    are as many more draws. Where the runs can be exchanged with those of the fit, each quantile is that of
    exchanges, if that is more. Where they cannot, yet logs are at hand in which nothing changed, the gains
    are scaled to what these show on average, if that is more: noise that is not normal, such as a few late
    responses, looks more like an effect. Where few differences of a robot's runs tell what varies from run
    to run (their `count`, by default that of all), gains are larger now and then (`ResidualProblem.luck`).
    """
    scatter = roller_scatter(problem, fitted)
    draws = _draws(false_alarm)
    orthogonal = np.linalg.qr(fitted.jacobian)[0]
    units, owners = [], []
    for response in library:
        column = response.change - orthogonal @ (orthogonal.T @ response.change)
        length = float(np.linalg.norm(column))
        if length > 1e-6 and response.effect not in fitted.names:
            units.append(column / length)
            owners.append(response)
    if not units:
        return ChanceGains(np.zeros(draws), false_alarm)
    columns = np.stack(units, axis=1)
    scores = rng.standard_normal((draws, len(units))) @ _root(columns.T @ columns).T
    scores += rng.standard_normal((draws, scatter.shape[1])) @ (scatter.T @ columns)
    count = problem.difference_counts.every if count is None else count
    gains = np.sort(_best_gains(scores, columns, owners) * problem.luck(rng, draws, count))
    if problem.exchange is not None and _is_exchangeable(problem, false_alarm):
        scores, costs = problem.exchange.drawn(rng, draws, fitted.residual, columns)
        exchanged = _best_gains(scores, columns, owners)
        # Beside a gain, the decision counts what is left as noise.
        exchanged /= np.maximum(1.0, (costs - exchanged) / problem.size)
        return ChanceGains(np.maximum(gains, np.sort(exchanged)), false_alarm)
    shown = _best_gains(problem.unchanged.T @ columns, columns, owners)
    scale = float(np.mean(shown) / np.mean(gains)) if shown.size else 1.0
    return ChanceGains(gains, false_alarm, max(1.0, scale))


def _best_gains(scores: FloatArray, columns: FloatArray, owners: Sequence[Response]) -> FloatArray:
    """Return the best gain in each of d residuals, given their projections `scores` (d, n) on n columns.

    The unit `columns` (N, n) are the responses of their `owners`.
    """
    gains = np.zeros(len(scores))
    steps: dict[tuple[str, tuple[float, ...]], list[int]] = {}
    for index, owner in enumerate(owners):
        if owner.linear:
            steps.setdefault((owner.effect, owner.beside), []).append(index)
    for joint in steps.values():
        gram = columns[:, joint].T @ columns[:, joint]
        together = scores[:, joint]
        gains = np.maximum(gains, np.einsum("di,ij,dj->d", together, np.linalg.pinv(gram), together))
    for name in dict.fromkeys(owner.effect for owner in owners):
        others = [i for i, o in enumerate(owners) if o.effect == name and not o.linear]
        if others:
            # A threshold acts in one direction only.
            gains = np.maximum(gains, np.max(np.minimum(scores[:, others], 0.0) ** 2, axis=1))
    return gains


def _root(covariance: FloatArray) -> FloatArray:
    values, vectors = np.linalg.eigh(covariance)
    root: FloatArray = vectors * np.sqrt(np.maximum(values, 0.0))
    return root
