"""Every number that a verdict depends on, with its source, its derivation or the reason for assuming it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from sysid.logs.runs import Level


@dataclass(frozen=True)
class Thresholds:
    """The numbers of the decision; "assumed" marks those that nothing but judgement supports."""

    false_alarm: float = 0.01
    """Probability with which noise alone is taken for an effect. Assumed."""
    draws: int = 2000
    """Simulated residuals for a threshold: the probability of a false alarm is then right to
    sqrt(0.01 x 0.99 / 2000) = 0.2 %."""
    power: float = 0.9
    """Probability with which an effect of the smallest detectable size is seen. Assumed; the usual choice."""
    least_power: float = 0.5
    """Probability with which an experiment must do what it is for to be offered. Assumed: below it, its
    recordings more often leave the question open than not, and a direct check costs a user less."""
    tie_sigmas: float = 3.0
    """Standard deviations by which a set may be worse than the best one and still be tied with it: if it is
    the truth, it is dropped with a probability of Phi(-3) = 0.13 %."""
    formula_error: float = 0.25
    """Relative error (rms) that the formula of an effect may have. Calibrated on drawn drives (bench seeds
    0-59, 300-399): where the hidden effect explains more than any other single one, it leaves 0 to 33 % of
    what any set explains, in 14 of 16 cases at most 27 %."""
    exact_formula: float = 0.1
    """The same where one set reaches the noise and another one does not: its formula is then no excuse; and
    of a factor, a delay or an angle, which have one formula only. Also the relative difference (rms) of two
    sets' predictions below which the one with more parameters says nothing new, and of a refitted law's
    prediction below which it does no better than effects. Assumed."""
    familiar_formula: float = 0.2
    """The first of these in the commands of the fit, where the noise is known so well that imperfect formulas
    seldom reach it. Calibrated on drawn drives that drive these commands again (bench seeds 700-799,
    850-899): with 0.1 one of 31 clear or gross single effects more was wrong and one overclaimed, with 0.2
    two right ones become rightly ambiguous."""
    crude_formula: float = 0.35
    """The same below which a set of fewer effects stays a candidate beside a larger one: it covers all of
    those drawn drives."""
    robot_formula: float = 0.35
    """`formula_error` on a robot beside the logs of its fit, whose model errs by more than that of a drive.
    Calibrated on drawn robots that drive the commands of the fit again (development seeds from 64 on):
    python benchmarks/robot_formulas.py prints what the right effect leaves beyond the best one (rms, of what
    that one explains). Assumed to hold in other commands, too: there a set may raise what is left in one
    command sequence by this share of what it explains in all."""
    crude_robot_formula: float = 0.6
    """`crude_formula` on such a robot, from what the right effect leaves there beyond the best set of any
    size."""
    adequate_residual: float = 0.5
    """Largest unexplained rms of an adequate single effect, relative to the rms that it explains; 1 / sqrt(k)
    of it for a set of k effects, which can adapt to more. Calibrated on drawn drives: with 0.2 two more of 15
    visible effects were `unexplained`, and as many names were wrong."""
    systematic_correlation: float = 0.25
    """Correlation of an unexplained residual with the response to a parameter. Assumed; it shifts an estimate
    in all command sequences alike, so that comparing them does not reveal it."""
    interval_correlation: float = 0.6
    """The same for the intervals that are reported: the error of a formula acts where the effect does, so
    that much of it shifts the size. Calibrated on drawn drives (bench seeds 0-99, 300-399, 500-580): of 11
    intervals of effects of the right form, 5 held the truth with 0.25, and 10 would with 0.6."""
    free_sigmas: float = 6.0
    """Standard deviations by which a free term must predict better than a set, beyond what `formula_error` of
    what the set explains is worth, to deny it its name. Calibrated on drawn drives (bench seeds 0-38,
    300-323): with 3 one of 8 right answers was lost, with 6 none; one wrong answer is denied with either. A
    curve is such a function, too: it is told beside causes only if it predicts better by as many."""
    most_of_it: float = 0.5
    """Share of the squared difference above the noise from which a set keeps its name although a free term
    does better: it is then most of what happened. Where something random acts, share of the whole squared
    difference, since the noise of repeats is part of what happened. Also what a set must remove where nothing
    says how large the model's own error is, and noise that lasts was measured in the same logs. Assumed."""
    plainly_visible: float = 1.5
    """Cost ratio above which an effect that brings the residual to the noise floor is accepted without the
    formula-error penalty: an error this far above expectation is not the residue of a formula. Also the ratio
    up to which an own error from a comparison with the logs of the fit, whose size is only roughly known, may
    be all of it, weighted or in plain squares. Assumed. In 13 logs of drawn drives in which nothing had
    changed the plain squares are at most 0.94 times what is expected, in three of six with a clear effect
    more than 3.6 times (python benchmarks/calibration.py)."""
    least_removed: float = 0.1
    """Share of the squared difference above the noise that a set must remove to be named; of a drive in other
    commands than those of its fit, also of that on test runs. Assumed: removing less lowers the rms by 5 % at
    most."""
    least_gain: float = 0.15
    """Share of the cost by which a set must lower it where the cost is not plainly visible, beside an own
    error from a comparison with the logs of the fit: its covariance is only roughly known, and chance is not.
    On drawn drives (python -m sysid.studies.zoo, bench seeds 0-59 and 300-399) five of the seven false alarms
    in 41 logs in which nothing had changed lower the cost by 5, 6, 11, 21 and 25 %; clear effects that were
    found lower it by 55 % or more, but for one of 25 %. Those drives alone would give 0.25, and lose that
    one."""
    least_familiar_gain: float = 0.1
    """The same in the commands of the logs of the fit, in which the error is known better, where these have
    no repeats, which would show what chance does. Calibrated on drawn drives (bench seeds 300-329), before
    repeats did: in 19 logs in which nothing had changed, driven with the commands of the fit, seven show an
    effect that chance would not, which lowers the cost by 9 % at most."""
    least_elsewhere: float = 0.045
    """By how much, as a share of the cost of a right model, a limit or a threshold must lower the cost in
    commands that a robot's fit did not drive: it may act there for the first time. Calibrated on drawn robots
    beside the logs of their fits (python benchmarks/calibration.py): where nothing had changed such effects
    promise 0.037 at most (robot 11 of the zoo), a hidden limit of the body's speed 0.057 (40). A backlash of
    0.011 (31) is lost, as are smaller ones. Any other set must lower the cost of the model as it is by
    this share there, unless every command sequence shows it alike: beyond their first order effects are not
    among the model's own error, so that three quiet robots were named some that lowered it by less."""
    least_on_bench: float = 0.25
    """The same of each effect of a set, or each number of a curve, on the bench, in commands that the fit of
    a drive did not drive, where the cost is not plainly visible: what the law lacks acts there in another
    way, and looks like an effect that is new. Calibrated on drawn drives (python benchmarks/calibration.py):
    of 40 in which nothing had changed, the best set of two lowers the cost by more (0.37, of two effects, and
    0.63), of 8 with a hidden effect that is not plainly visible four do."""
    above_noise: float = 4.0
    """Mean squared error, in noise variances, too large to be the model's own even if nothing states that.
    Calibrated: laws leave 1.9 in the example's logs that they were fitted to, and 11, 29 and 73 in recordings
    of a Robotino, a Husky and a micromouse."""
    needless_square: float = 4.0
    """A parameter is left out if it is within two standard deviations of neutral, the usual 95 %, and if the
    cost rises by no more than this without it."""
    rms_rise: float = 1.01
    """Ratio of validation rms that counts as a rise. With some hundred samples noise, which both fits share,
    changes the ratio by less. Also of the rms of all runs that decide, of a robot in other commands than
    those of its fit."""
    large_rms_rise: float = 1.05
    """The same that counts even if pieces of the runs disagree about it; and the ratio of the rms of test
    runs from which these refute a set. Assumed."""
    resamples: int = 500
    """Bootstrap resamples: a selection frequency is then right to sqrt(0.25 / 500) = 2 %."""
    interval_level: float = 0.9
    """Probability that an interval holds the parameter. The zoo counts how many do."""
    fewest_groups: int = 4
    """Command sequences from which their disagreement is estimated; the spread of fewer is unknown to a
    factor of two. Assumed."""
    inconsistent_repeats: float = 2.0
    """Ratio of the scatter between repeats to that of neighbouring samples, on the bench, that is worth a
    note. Assumed."""
    unrepeatable: float = 5.0
    """The same ratio from which repeats are no repeats, and no effect of the commands can be all of the
    difference. Assumed."""

    def formula(self, *, beside_fit_of_robot: bool) -> float:
        """Return the relative error (rms) that the formula of an effect may have.

        `beside_fit_of_robot`: in a study of a robot beside the logs of its fit.
        """
        return self.robot_formula if beside_fit_of_robot else self.formula_error


THRESHOLDS: Final = Thresholds()


@dataclass(frozen=True)
class SearchEffort:
    """How many sets of effects are fitted by full simulation, so that a study takes some minutes at most."""

    singles: int = 12
    pairs: int = 12
    triples: int = 6
    swaps: int = 20
    """Sets that differ from the best one in one effect."""
    beam: int = 4
    """Sets of one size that the next size grows from."""
    log_s: float = 240.0
    """Duration of the runs that decide, repeats not counted [s]."""

    def of_size(self, size: int) -> int:
        """Return how many sets of a size are fitted at a time."""
        return {1: self.singles, 2: self.pairs}.get(size, self.triples)


EFFORT: Final[Mapping[Level, SearchEffort]] = {
    "bench": SearchEffort(40, 16, 8, 20, 5, 240.0),
    "robot": SearchEffort(8, 8, 4, 4, 3, 60.0),
}
BESIDE_FIT_OF_ROBOT: Final = SearchEffort(40, 16, 8, 20, 5, 60.0)
"""The effort for a robot beside the logs of its fit: there the planar plant does nearly all of the work."""
