"""What chance does: the cost that a right model has, the gain of a needless effect, what would be seen.

A right model leaves noise and, on robots, the scatter of the rollers at the place of the set. The noise
variance is estimated from finitely many samples, so that the ratio of a cost to it follows an F distribution.

If a fitted set is the whole truth, its marginal residual is white, except for the scatter of the rollers.
Drawing such residuals and growing the set by every effect of the library, as the search does, gives the
distribution of the best gain by chance, whatever the number of effects and their likeness. Only the inner
products of the responses are needed: the projections U = C' r on unit columns C are normal with covariance
C' (I + R R') C, where R are the columns of `roller_scatter`. An effect is seen if its response is long enough
to pass that threshold with probability `power`.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.stats import f as f_distribution
from scipy.stats import norm

from mecanum_env.effects import CATALOGUE, Effect
from mecanum_env.units import FloatArray
from sysid.compare.least_squares import Fitted, ResidualProblem
from sysid.gap.result import Untestable
from sysid.gap.search.responses import Response
from sysid.gap.search.single_run import single_run
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.logs.runs import Level

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
    return floor.chance(
        (fitted.cost - _of_one_run(problem, fitted)) / expected(problem, fitted), problem.size
    )


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
    return fitted.cost - _of_one_run(problem, fitted) <= expected(problem, fitted) * ratio


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
    explained = float(np.sum((base.residual - fitted.residual) ** 2))
    share = THRESHOLDS.adequate_residual**2 / max(1, len(fitted.names))
    return fitted.cost - _of_one_run(problem, fitted) <= allowed + share * explained


_MOST_DRAWS: Final = 32.0
"""Largest number of draws in those of a first study: enough for six studies of the same logs."""
_NO_RESPONSE: Final = 0.1
"""Length of a response, in noise sigmas over all samples, below which nothing measured depends on it."""


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
        above = self.gains.size - int(np.searchsorted(self.gains, gain / self.scale, side="left"))
        return (above + 1.0) / (self.gains.size + 1.0)


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
    are as many more draws. Where logs are at hand in which nothing changed, the gains are scaled to what
    these show on average, if that is more: noise that is not normal, such as a few late responses, looks more
    like an effect. Where few differences of a robot's runs tell what varies from run to run (their `count`,
    by default that of all), gains are larger now and then (`ResidualProblem.luck`).
    """
    scatter = roller_scatter(problem, fitted)
    draws = math.ceil(THRESHOLDS.draws * max(1.0, min(THRESHOLDS.false_alarm / false_alarm, _MOST_DRAWS)))
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
    gains = _best_gains(scores, columns, owners) * problem.luck(rng, draws, count)
    shown = _best_gains(problem.unchanged.T @ columns, columns, owners)
    scale = float(np.mean(shown) / np.mean(gains)) if shown.size else 1.0
    return ChanceGains(np.sort(gains), false_alarm, max(1.0, scale))


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


def smallest_detectable(
    library: Sequence[Response], threshold: float, least: Mapping[str, float]
) -> dict[str, dict[str, float]]:
    """Return effect -> parameter -> smallest value that would be seen with 90 % probability.

    Seen is what lowers the cost by a `threshold`, and by the `least` fall that an effect needs, if any. A
    parameter of which no value would be seen is left out. `library` holds the responses of the effects on
    these logs.
    """
    found: dict[str, dict[str, float]] = {}
    by_parameter: dict[tuple[str, str], list[Response]] = {}
    for response in library:
        if not any(coordinate.like for coordinate in response.chosen.coordinates):
            key = response.effect, response.chosen.coordinates[0].parameter
            by_parameter.setdefault(key, []).append(response)
    for (name, parameter), own in by_parameter.items():
        fall = max(threshold, least.get(name, 0.0))
        value = _smallest(own, float((np.sqrt(fall) + norm.ppf(THRESHOLDS.power)) ** 2))
        if value is not None:
            found.setdefault(name, {})[parameter] = value
    return found


def untestable(
    considered: Sequence[str],
    library: Sequence[Response],
    detectable: Mapping[str, Mapping[str, float]],
    level: Level,
    columns: Collection[str],
    *,
    command_falls: bool = True,
) -> tuple[Untestable, ...]:
    """Return which of the considered effects logs of a level could not show, with the reason.

    `library` holds their responses, `detectable` is from `smallest_detectable`; `columns` are those of the
    logs, and `command_falls` is as in `Dataset`.
    """
    found = []
    for name, effect in CATALOGUE.items():
        if name in considered and name not in detectable:
            lengths = [response.length for response in library if response.effect == name]
            found.append(Untestable(name, _unseen(effect, lengths), {}))
        elif not effect.unsearched_on and not effect.readable_in(columns):
            missing = " and ".join(column for column in effect.reads if column not in columns)
            found.append(Untestable(name, f"these logs have no {missing}, which it follows: log it", {}))
        elif level == "bench" and effect.needs_falling_command and not command_falls:
            reason = (
                "no command of these logs falls or reverses, and a gap that is passed once, at the start, is "
                "no other than a delay: drive reversals"
            )
            found.append(Untestable(name, reason, {}))
        elif effect.simulated and level == "bench" and "bench" in effect.absent_from:
            found.append(Untestable(name, f"a bench log has no {effect.acts_on}: record a robot log", {}))
        elif level == "bench" and name == effect.cause and effect.unsearched_on == ("bench",):
            reason = "a bench log does not tell it from the friction that it makes larger: record a robot log"
            found.append(Untestable(name, reason, {}))
    return tuple(found)


def _unseen(effect: Effect, lengths: Sequence[float]) -> str:
    """Return why logs could not show an effect, from how much each size that was simulated changes them."""
    if not lengths:
        return "no size of it could be simulated with this model"
    if max(lengths) > _NO_RESPONSE:
        return (
            "even the largest size of the search would change these logs by less than noise or the "
            "model's own error does"
        )
    return f"no measured channel responds to it under the {_given(effect)} of these logs"


def _given(effect: Effect) -> str:
    """Return what an effect needs to show, in words."""
    return " and ".join(("commands", *effect.reads))


def _smallest(own: Sequence[Response], needed: float) -> float | None:
    """Return the value of a parameter whose response has the squared length `needed`, None if none has."""
    if own[0].linear:
        response = max(own, key=lambda r: r.length)
        if response.length <= _NO_RESPONSE:
            return None
        first, neutral = response.chosen.coordinates[0], response.chosen.coordinates[0].neutral_place
        at = neutral + (float(response.place[0]) - neutral) * np.sqrt(needed) / response.length
        return first.value(float(at)) if -1e-9 <= at <= 1.0 + 1e-9 else None
    # Linear interpolation between the sizes that were simulated.
    best: dict[float, float] = {}
    for response in own:
        best[response.size] = max(best.get(response.size, 0.0), response.length)
    sizes = np.array([0.0, *sorted(best)])
    lengths = np.array([0.0, *(best[size] for size in sorted(best))])
    longest = np.maximum.accumulate(lengths)
    target = float(np.sqrt(needed))
    if longest[-1] < target:
        return None
    index = int(np.argmax(longest >= target))
    part = (target - longest[index - 1]) / max(longest[index] - longest[index - 1], 1e-12)
    size = sizes[index - 1] + part * (sizes[index] - sizes[index - 1])
    first = own[0].chosen.coordinates[0]
    direction = np.sign(float(own[0].place[0]) - first.neutral_place)
    return first.value(float(np.clip(first.neutral_place + direction * size, 0.0, 1.0)))
