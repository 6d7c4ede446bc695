"""How good a fitted set is: its score, its plain error, and how sure its parameters are.

The score says how well each group of runs is predicted from the others. With the residual linear in the
parameters p and in the model's own error z about the fit,

    r = r0 + J theta,    theta = (p, z),    J = (Jp, -X),    theta ~ N(0, prior),

the predictive density of a group g given all others is normal, with

    r_g = r0_g + J_g m,   C_g = I + J_g H^-1 J_g',   H = J_o' J_o + prior^-1,   m = -H^-1 J_o' r0_o,

where o are the other groups. The score is the sum over the groups of r_g' C_g^-1 r_g + log |C_g|: minus twice
the log predictive density by leave-one-group-out cross-validation (for its use: Vehtari, Gelman and Gabry,
Statistics and Computing 27:1413, 2017). A needless parameter costs, a needed one gains.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy.stats import chi2, norm, t

from mecanum_env.effects import CATALOGUE
from mecanum_env.model import cause_of
from mecanum_env.units import FloatArray
from sysid.compare.least_squares import (
    PRIOR,
    Fitted,
    Minimum,
    ResidualProblem,
    derivative_free,
    function_near,
    marginal_function,
    reach,
)
from sysid.compare.measured import Observations
from sysid.compare.search_space import EffectSet
from sysid.gap.search.plain_squares import mean_squares
from sysid.gap.search.thresholds import THRESHOLDS

_PIECE_S: Final = 1.0
"""Length of the pieces of a run [s] whose errors count as independent: a few responses of a drive.
Assumed."""


@dataclass(frozen=True, eq=False)
class ScoredSet:
    """A fitted set with its scores."""

    fitted: Fitted[Any]
    scores: FloatArray
    """Score of each group of runs; lower is better."""
    least: float = -math.inf
    """Squares that the fit itself leaves, on the scale of the score: predicted from others, it is no less."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return self.fitted.names

    @property
    def causes(self) -> tuple[str, ...]:
        """Causes of the effects, whatever their forms."""
        return tuple(map(cause_of, self.names))

    @property
    def score(self) -> float:
        """Sum over the groups, or what the fit itself leaves where that is more.

        The sum goes along a straight line from where the fit ended. Where that leads to less than the fit
        reached, it leads out of the bounds, or on from where a descent ended early.
        """
        return max(float(np.sum(self.scores)), self.least)


def scored(problem: ResidualProblem, fitted: Fitted[Any], inflation: float = 1.0) -> ScoredSet:
    """Return a set that was fitted to all groups of runs with the score of each group.

    `inflation` is a factor on all variances, if the best fit leaves more than expected.
    """
    p = fitted.jacobian.shape[1]
    if problem.knows_all:
        # Else the other groups move what the logs of the fit say, until that explains any lasting difference.
        columns, residual = fitted.jacobian, fitted.residual
    else:
        residual = problem.marginal_inverse(fitted.residual)
        columns = np.concatenate([problem.marginal_inverse(fitted.jacobian), -problem.nuisance], axis=1)
    columns, residual = columns / np.sqrt(inflation), residual / np.sqrt(inflation)
    prior = np.concatenate([np.full(p, 1.0 / PRIOR**2), np.full(columns.shape[1] - p, 1.0 / inflation)])
    normal = columns.T @ columns + np.diag(prior)
    gradient = columns.T @ residual
    whole = np.linalg.cholesky(normal)
    scores = []
    for mask in group_masks(problem):
        ours, left = columns[mask], residual[mask]
        information = normal - ours.T @ ours
        factor = np.linalg.cholesky(information)
        mean = -np.linalg.solve(information, gradient - ours.T @ left)
        predicted = left + ours @ mean
        # (I + J H^-1 J')^-1 by Woodbury, and its determinant by Sylvester.
        half = np.linalg.solve(whole, ours.T @ predicted)
        square = float(predicted @ predicted - half @ half)
        logarithm = 2.0 * float(np.sum(np.log(np.diag(whole))) - np.sum(np.log(np.diag(factor))))
        scores.append(square + logarithm)
    return ScoredSet(fitted, np.array(scores), _least(residual, columns[:, p:], prior[p:]))


def _least(residual: FloatArray, error: FloatArray, prior: FloatArray) -> float:
    """Return the squares of a `residual` (N,) that are left where the fit ended.

    The columns (N, q) of the model's own `error` are free, with their inverse variances (q,) as the `prior`.
    """
    size = np.linalg.solve(error.T @ error + np.diag(prior), error.T @ residual)
    return float(np.sum((residual - error @ size) ** 2))


def group_masks(problem: ResidualProblem) -> list[npt.NDArray[np.bool_]]:
    """Return for each group of runs which of the N values belong to it."""
    masks: dict[str, npt.NDArray[np.bool_]] = {}
    observations = problem.observations
    for block, place in zip(observations.blocks, problem.whitener.slices, strict=True):
        group = observations.situations[block.situation].group
        masks.setdefault(group, np.zeros(problem.size, bool))[place] = True
    return list(masks.values())


def raw_rms(
    problem: ResidualProblem, observations: Observations, parts: Sequence[FloatArray], split: str
) -> float:
    """Return the rms of a residual over single samples of a split, without any weighting by noise that lasts.

    In the channel's unit if there is one channel, else in noise sigmas; NaN without runs of the split.
    `parts` has one array (m,) of measured minus simulated per block of the observations.
    """
    alone = len(problem.observations.channels) == 1
    squares = weights = 0.0
    for block, part in zip(observations.blocks, parts, strict=True):
        if observations.situations[block.situation].split == split:
            scale = 1.0 if alone else problem.whitener.noise.sigma[block.channel]
            squares += (float(block.weight @ part**2) + block.repeat_squares) / scale**2
            weights += float(block.weight.sum())
    return math.sqrt(squares / weights) if weights else math.nan


def fitted_rms(problem: ResidualProblem, fitted: Fitted[Any], split: str) -> float:
    """Return `raw_rms` of a fit on the runs of a split that decide."""
    parts = problem.whitener.unwhiten(problem.marginal_inverse(fitted.residual))
    return raw_rms(problem, problem.observations, parts, split)


def rises(problem: ResidualProblem, base: Fitted[Any], fitted: Fitted[Any]) -> bool:
    """Return whether a fit has a larger error on the validation runs than the model as it is (`base`).

    A set that gains only by the weights of a small noise, or of the model's own error, is refused by this. A
    small rise must be larger than what pieces of the runs differ by, as a one-sided t test tells: in a few
    seconds a set that is right may do a little worse by chance. The error is the plain one, except where the
    logs of the fit told what every effect does: there the plain one is mostly that of the model, which
    differs from run to run, and what is left beside it counts, in every command sequence. In other commands
    than those of the fit the plain one of all runs counts, too: what those logs say of the error there is an
    extrapolation, and a set may lower what is left beside it by having the model miss the robot by more.
    """
    if problem.knows_all:
        return _rises_somewhere(problem, base, fitted) or (
            not problem.same_commands
            and mean_squares(problem, fitted) > THRESHOLDS.rms_rise**2 * mean_squares(problem, base)
        )
    before, after = (_plain_squares(problem, one) for one in (base, fitted))
    if np.sum(after) <= THRESHOLDS.rms_rise**2 * np.sum(before):
        return False
    more, count = after - before, before.size
    if count < THRESHOLDS.fewest_groups or np.sum(after) > THRESHOLDS.large_rms_rise**2 * np.sum(before):
        return True
    limit = t.ppf(0.5 * (1.0 + THRESHOLDS.interval_level), count - 1) * np.std(more, ddof=1)
    return bool(np.sum(more) > limit * math.sqrt(count))


def _rises_somewhere(problem: ResidualProblem, base: Fitted[Any], fitted: Fitted[Any]) -> bool:
    """Return whether a fit raises the marginal residual in a command sequence, or on the validation runs.

    A right set that changes the residual by d there lowers its square by |d|^2 on average, with the standard
    deviation 2 |d| times that of the residual. So it raises the square by chance with a probability that |d|
    gives; a rise counts where that is below the one of a false alarm, shared by all places that are asked.
    In other commands than those of the fit it must be more than the formula of a set may leave of all that
    the set explains, too.
    """
    masks = group_masks(problem)
    blocks = zip(problem.observations.blocks, problem.whitener.slices, strict=True)
    validation = np.zeros(problem.size, bool)
    for block, rows in blocks:
        validation[rows] = problem.observations.situations[block.situation].split == "validation"
    masks.append(validation)
    sigma = math.sqrt(max(1.0, fitted.cost / problem.size))
    formula = 0.0 if problem.same_commands else THRESHOLDS.robot_formula
    may_be_left = formula**2 * max(0.0, base.cost - fitted.cost)
    for mask in masks:
        before, after = base.residual[mask], fitted.residual[mask]
        by_chance = norm.cdf(-float(np.linalg.norm(after - before)) / (2.0 * sigma))
        rise = float(after @ after - before @ before)
        if rise > may_be_left and by_chance < THRESHOLDS.false_alarm / len(masks):
            return True
    return False


def _plain_squares(problem: ResidualProblem, fitted: Fitted[Any]) -> FloatArray:
    """Return the squared errors of a fit in pieces of the validation runs, in noise variances, shape (k,)."""
    parts = problem.whitener.unwhiten(problem.marginal_inverse(fitted.residual))
    found = []
    for block, part in zip(problem.observations.blocks, parts, strict=True):
        if problem.observations.situations[block.situation].split == "validation":
            piece = np.floor(block.time_s / _PIECE_S).astype(np.intp)
            squares = block.weight * part**2 / problem.whitener.noise.sigma[block.channel] ** 2
            found.append(np.bincount(piece - piece[0], squares)[np.unique(piece - piece[0])])
    return np.concatenate(found) if found else np.zeros(0)


def interval_ends(
    problem: ResidualProblem,
    fitted: Fitted[EffectSet],
    inflation: float,
    correlation: float = THRESHOLDS.systematic_correlation,
) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper ends of the 90 % intervals, each (p,), on the scale 0 .. 1 and beyond.

    An interval is the wider of two: that of the linearised fit, which includes noise, the model's own error,
    the `inflation`, the unexplained residual and the error that the formulas may have, both with this
    `correlation` with the response to a parameter; and that of the groups, from how
    much each of them would move the estimate (Liang and Zeger, Biometrika 73:13, 1986), which assumes nothing
    about the errors. Where the cost has no slope (a threshold between two commands) it reaches as far as the
    cost does not rise.
    """
    tail = 0.5 * (1.0 + THRESHOLDS.interval_level)
    variance = np.diag(fitted.covariance(_variance(problem, fitted, inflation, correlation)))
    half = norm.ppf(tail) * np.sqrt(variance)
    half = np.fmax(half, _spread_of_groups(problem, fitted, tail))
    low, high = fitted.place - half, fitted.place + half
    minimum = Minimum(fitted.place, fitted.residual, fitted.jacobian, 0)
    full = marginal_function(problem, fitted.candidate)
    quick = problem.surrogate_mask(fitted.candidate.owners)
    beyond = np.where(quick, 0.0, fitted.jacobian)
    near = function_near(problem, fitted.candidate, fitted.place, fitted.residual, beyond)
    rise = chi2.ppf(THRESHOLDS.interval_level, 1) * inflation
    for i in np.flatnonzero(derivative_free(minimum, fitted.candidate.stepwise)):
        down, up = reach(near if quick[i] else full, minimum, int(i), rise)
        low[i], high[i] = fitted.place[i] - down, fitted.place[i] + up
    return low, high


def _spread_of_groups(problem: ResidualProblem, fitted: Fitted[EffectSet], tail: float) -> FloatArray:
    """Return how far a set's parameters may be off by how much each group of runs would move them, (p,).

    It is the quantile `tail` of Student's t; NaN where there are too few groups to tell.
    """
    masks = group_masks(problem)
    if len(masks) < THRESHOLDS.fewest_groups:
        return np.full(fitted.place.size, math.nan)
    pulls = np.array([fitted.jacobian[mask].T @ fitted.residual[mask] for mask in masks])
    squares = np.sum((pulls @ fitted.covariance()) ** 2, axis=0)
    return np.asarray(t.ppf(tail, len(masks) - 1) * np.sqrt(squares * len(masks) / (len(masks) - 1)))


def agreed_on(problem: ResidualProblem, fitted: Fitted[EffectSet], level: float) -> bool:
    """Return whether the groups of runs agree about each effect of a set that it is there.

    By their spread alone, whatever a model or formula may err by, the interval of this `level` of a parameter
    that says so does not reach neutral.
    """
    off = np.abs(fitted.place - fitted.candidate.start())
    sure = off > _spread_of_groups(problem, fitted, 0.5 * (1.0 + level))
    sure &= np.array(fitted.candidate.decisive(problem.base), bool) & np.any(fitted.jacobian != 0.0, axis=0)
    return {owner for owner, one in zip(fitted.candidate.owners, sure, strict=True) if one} == set(
        fitted.names
    )


def doubtful(problem: ResidualProblem, fitted: Fitted[EffectSet], inflation: float) -> tuple[str, ...]:
    """Return the effects of a set that may as well be none.

    No parameter that says that it acts is surely away from neutral. Of several parameters each may be vague
    where the effect as a whole is not, such as a share that is reached after an unknown time; the whole is
    sure if the runs agree that it is there, at whatever size. `inflation` is the residual variance of the
    best fit relative to the expected one.
    """
    low, high = interval_ends(problem, fitted, inflation)
    neutral = fitted.candidate.start()
    clear = np.array(fitted.candidate.decisive(problem.base)) & ((neutral < low) | (neutral > high))
    owners = fitted.candidate.owners
    sure = {effect for effect, is_clear in zip(owners, clear, strict=True) if is_clear}
    vague = [name for name in fitted.names if name not in sure]
    return tuple(
        name
        for name in vague
        if _is_proportional(problem, fitted.candidate, name)
        or not _surely_there(problem, fitted, name, inflation)
    )


def _is_proportional(problem: ResidualProblem, candidate: EffectSet, name: str) -> bool:
    """Return whether an effect of a candidate is there as surely as its parameter is not neutral.

    A robot's limit on the speed of its body is not: how large it is may be vague where that it acts is not.
    Nor is a ripple, of which a mean of repeats with unknown phases tells no more than a variance. Nor is a
    limit that is neutral beyond its range: at the end of that it acts, and at the neutral value it does not.
    """
    own = [one for one in candidate.coordinates if one.effect == name]
    one_slope = len(own) < 2 and all(one.reaches_neutral for one in own)
    return one_slope and not problem.knows_all and not CATALOGUE[name].follows_angle


def _surely_there(problem: ResidualProblem, fitted: Fitted[EffectSet], name: str, inflation: float) -> bool:
    """Return whether the share of an effect, 1 as fitted and 0 without it, is surely above 0.

    Its interval is found as in `interval_ends`, with the other effects free.
    """
    candidate = fitted.candidate
    others = np.array([owner != name for owner in candidate.owners], bool)
    without = candidate.only([other for other in fitted.names if other != name])
    residual = problem.residual(without.model(problem.base, fitted.place[others]))
    if residual is None:
        return False
    response = problem.marginal(residual) - fitted.residual
    basis = np.linalg.qr(fitted.jacobian[:, others])[0]
    response = response - basis @ (basis.T @ response)
    square = float(response @ response)
    if square == 0.0:
        return False
    tail = 0.5 * (1.0 + THRESHOLDS.interval_level)
    half = norm.ppf(tail) * math.sqrt(_variance(problem, fitted, inflation) / square)
    masks = group_masks(problem)
    if len(masks) >= THRESHOLDS.fewest_groups:
        moves = np.array([response[mask] @ fitted.residual[mask] for mask in masks]) / square
        spread = math.sqrt(float(np.sum(moves**2)) * len(masks) / (len(masks) - 1))
        half = max(half, t.ppf(tail, len(masks) - 1) * spread)
    return bool(half < 1.0)


def _variance(
    problem: ResidualProblem,
    fitted: Fitted[Any],
    inflation: float,
    correlation: float = THRESHOLDS.systematic_correlation,
) -> float:
    """Return the variance of the residual that the intervals of a fit allow for, relative to the noise."""
    explained = float(np.sum((problem.marginal(problem.base_residual) - fitted.residual) ** 2))
    left = max(0.0, fitted.cost - problem.size) + THRESHOLDS.formula_error**2 * explained
    return inflation + correlation**2 * left
