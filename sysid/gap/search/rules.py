"""The rules of the decision: each looks at the same facts and gives a verdict with its reason, or passes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final, TypeAlias

from mecanum_env.effects import CATALOGUE
from sysid.gap.result import Verdict
from sysid.gap.search.chance import Floor
from sysid.gap.search.scores import ScoredSet
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.gap.search.ties import is_description


@dataclass(frozen=True, eq=False)
class Facts:
    """What the rules know of a study."""

    floor: Floor
    """What is known of the noise floor."""
    noise_ratio: float
    """Mean squared error of the model as it is over single samples, in noise variances."""
    p_value: float
    """Probability that a right model differs as much from the logs."""
    p_misfit: float
    """The same by the whole residual alone, whatever effects could remove."""
    is_plain: bool
    """Whether the whole residual, weighted or plain, is far more than a right model leaves, however roughly
    that is known."""
    inflation: float
    """Residual variance of the best fit relative to the expected noise variance (at least 1)."""
    is_clear: bool = False
    """Whether the chosen set lowers the cost by far more than chance does, in logs of a robot of which the
    own error is known from the logs of its fit."""
    chosen: ScoredSet | None = None
    """Best set of the size that the logs support; None if nothing is significant or could be fitted."""
    judged: tuple[ScoredSet, ...] = ()
    """All sets that were fitted, the empty one too; best score first."""
    tied: tuple[ScoredSet, ...] = ()
    """Sets that explain the logs as well as the chosen one, which comes first."""
    consequences: tuple[str, ...] = ()
    """Notes about limits in these sets that may be what their loads do to the drive."""
    law: ScoredSet | None = None
    """The wheel law fitted again, if that was tried."""
    law_allowed: float = THRESHOLDS.tie_sigmas**2
    """By how much its score may be better: it has more parameters than an effect, and formulas err a
    little."""
    free: ScoredSet | None = None
    """A smooth function that no cause is behind, as the rival of the chosen set, if that was tried."""
    allowed: float = math.inf
    """By how much the score of the free term may be better, since the formulas of the chosen set may err."""
    adequate: bool = False
    """Whether the chosen set leaves what noise allows, or little beside what it explains."""
    removed: float = 0.0
    """Share of the squared difference above the noise that the chosen set removes."""
    removed_of_all: float = 0.0
    """Share of the squared difference of single samples, what differs between repeats included, that it
    removes."""
    gain: float = math.inf
    """Share of the cost by which the chosen set lowers it."""
    raises_rms: bool = False
    """Whether the chosen set raises the plain error on the validation runs, or what is left beside the error
    that the logs of a robot's fit show, in a command sequence."""
    doubtful: tuple[str, ...] = ()
    """Effects of the chosen set of which no parameter is surely away from neutral."""
    systematic: bool = False
    """Whether each effect of the chosen set shows alike in every command sequence, so clearly that none of
    all that were tried would by chance; asked of a robot beside the logs of its fit."""
    frequency: Mapping[str, float] = field(default_factory=dict)
    """Effect of the chosen set -> share of resamples in which it is chosen."""
    by_chance: float = 0.0
    """Fall of the cost of a robot's logs beside those of its fit that chance may reach."""
    by_one: float = 0.0
    """The same of a single command sequence."""
    of_one_sequence: bool = False
    """Whether one command sequence of a robot shows nearly all that the chosen set explains, and chance may
    do that there."""
    fall: float = math.inf
    """By how much the chosen set lowers the cost, as a share of a right model's."""

    @property
    def significant(self) -> str:
        """Beginning of a note about a set that is significant and yet not named."""
        name = " + ".join(self.chosen.names) if self.chosen else ""
        return f"{name} would be significant (p = {self.p_value:.2g}), but"


@dataclass(frozen=True)
class Outcome:
    """A verdict and the reasons for it, in sentences."""

    verdict: Verdict
    reasons: tuple[str, ...] = ()


Rule: TypeAlias = Callable[[Facts], Outcome | None]


def _far_apart(facts: Facts) -> Outcome | None:
    """Unexplained: nothing says how large the model's own error is, and the residual is plainly no noise.

    An error that was measured on these very logs contains any gap, and so excuses none. Where noise that
    lasts was measured in them, too, a set must remove most of the difference.
    """
    near = facts.floor.trusted or facts.noise_ratio <= THRESHOLDS.above_noise
    least = THRESHOLDS.most_of_it if facts.floor.lasting else THRESHOLDS.least_removed
    if near or facts.removed >= least:
        return None
    reason = (
        f"the difference is {math.sqrt(facts.noise_ratio):.2g} times the noise (rms), and no set of effects "
        f"removes {least:.0%} of its square"
    )
    return _unexplained(facts, reason)


def _not_significant(facts: Facts) -> Outcome | None:
    """No gap: neither the best effect nor the whole residual is more than chance allows."""
    return Outcome("no_gap") if facts.p_value > facts.floor.false_alarm else None


def _of_one_sequence(facts: Facts) -> Outcome | None:
    """No gap: one sequence shows nearly all that the best set explains, and chance may do that there.

    Unexplained if the whole residual is more than a right model leaves.
    """
    if not facts.of_one_sequence:
        return None
    reason = (
        f"{facts.significant} one command sequence shows nearly all of it: drive it again to see whether it "
        "was chance"
    )
    by_chance = facts.p_misfit > facts.floor.false_alarm
    return Outcome("no_gap", (reason,)) if by_chance else _unexplained(facts, reason)


def _within_own_error(facts: Facts) -> Outcome | None:
    """No gap: beside the logs of the fit the residual is about as large as expected, and no set lowers it.

    Each effect of a set must, since each of two that chance makes up takes its share, and so must each number
    of a curve that no cause is behind. Where repeats in the logs of the fit show what chance does and what
    varies from run to run, what is significant is no chance: of 60 drawn drives in which nothing had changed
    (python -m sysid.studies.zoo --driven same, bench seeds 700-799, 850-899, 1200-1249) none was. In other
    commands than those of a robot's fit, what each effect does is known to first order only.
    """
    floor, gain = facts.floor, facts.gain if facts.chosen else 0.0
    if not floor.compared or floor.calibrated or facts.is_plain:
        return None
    if floor.knows_all:
        known = floor.familiar or facts.chosen is None or facts.systematic
        return (
            None
            if known or gain >= THRESHOLDS.least_elsewhere
            else Outcome("no_gap", (_hardly_lowers(facts),))
        )
    each = THRESHOLDS.least_familiar_gain if floor.familiar else THRESHOLDS.least_gain
    if facts.chosen is None:
        return Outcome("no_gap", ("the difference is no larger than the model's own error may be",))
    if gain < each * _shares(facts.chosen):
        return Outcome("no_gap", (_hardly_lowers(facts),))
    if facts.fall < floor.least_share * _shares(facts.chosen):
        return Outcome("no_gap", (_as_in_new_commands(facts),))
    return None


def _shares(chosen: ScoredSet | None) -> int:
    """Return how many effects or, of a description, numbers a set has; 1 for none."""
    if chosen is None:
        return 1
    return int(chosen.fitted.candidate.parameter_count) if is_description(chosen) else len(chosen.names)


def _hardly_lowers(facts: Facts) -> str:
    return (
        f"{facts.significant} lowers the squared difference by {facts.gain:.0%} only, which is no larger "
        "than the model's own error in the logs of the fit lets expect"
    )


def _as_in_new_commands(facts: Facts) -> str:
    return (
        f"{facts.significant} removes only {facts.fall:.0%} of what the model may be off by in commands that "
        "its fit did not drive: drive the commands of the fit again, in which its own error cancels"
    )


def _inadequate(facts: Facts) -> Outcome | None:
    """Unexplained: no effect could be fitted, or the chosen set leaves more than an imperfect formula can.

    A set of causes that removes nearly all of the plain difference keeps its name: it is not all, and the
    report says so. No gap where the command sequences of a robot's fit differ by as much as the whole
    residual, and no set lowers it clearly.
    """
    if facts.adequate or _is_nearly_all(facts):
        return None
    if facts.floor.knows_all and facts.chosen is not None and may_be_noise(facts):
        reason = f"{facts.significant} the command sequences of the fit differ by as much as all that is left"
        return Outcome("no_gap", (reason,))
    return _unexplained(facts)


def _is_nearly_all(facts: Facts) -> bool:
    """Return whether the chosen set leaves little of the plain difference, and nothing else predicts as well.

    The weights of the residual count most where noise and the model's own error are small, and no formula is
    as good as that. The plain squares are those of the error that is to be explained: of them a set may leave
    the same share. A smooth function, which only a bench has, must do worse, and the wheel law fitted again,
    which has more numbers than an effect, no better.
    """
    if facts.chosen is None or facts.free is None or is_description(facts.chosen):
        return False
    share = THRESHOLDS.adequate_residual**2 / len(facts.chosen.names)
    margin, score = THRESHOLDS.tie_sigmas**2, facts.chosen.score
    alone = facts.free.score > score + margin and (facts.law is None or facts.law.score > score - margin)
    return alone and facts.removed >= 1.0 / (1.0 + share)


def _left_over(facts: Facts) -> str:
    """Return that the named set leaves more than chance and formulas explain; empty if it does not."""
    if facts.adequate or facts.chosen is None:
        return ""
    return (
        f"{' + '.join(facts.chosen.names)} removes {min(facts.removed, 1.0):.0%} of the squared difference "
        "above the noise, and leaves more than chance allows: its formula is not exact, or it is not all"
    )


def _too_small(facts: Facts) -> Outcome | None:
    """No gap: the chosen set is significant and removes next to nothing.

    In the commands of the fit, an error that its logs show, too, may be most of the plain difference. Beside
    it a set matters that leaves a plainly visible residual what noise allows, or little of what it explains;
    and so it does where repeats show what chance does, as in `_within_own_error`.
    """
    if facts.removed >= THRESHOLDS.least_removed or facts.floor.knows_all:
        return None
    if facts.floor.familiar and (facts.is_plain or facts.floor.calibrated) and facts.adequate:
        return None
    reason = (
        f"{facts.significant} removes only {max(facts.removed, 0.0):.0%} of the difference above the noise: "
        "it cannot be told from the model's own error"
    )
    return Outcome("no_gap", (reason,))


def _harmful(facts: Facts) -> Outcome | None:
    """Unexplained: the chosen set raises the error on the validation runs.

    No gap if nothing but this set says that there is one, beside the known error of a robot's model.
    """
    if not facts.raises_rms:
        return None
    if not facts.floor.knows_all:
        return _unexplained(facts, f"{facts.significant} raises the plain difference on the validation runs")
    reason = f"{facts.significant} raises the difference beside the model's own error in a command sequence"
    return Outcome("no_gap", (reason,)) if may_be_noise(facts) else _unexplained(facts, reason)


def may_be_noise(facts: Facts) -> bool:
    """Return whether the whole residual is what a right model leaves, and no set lowers it clearly."""
    return facts.floor.trusted and facts.p_misfit > facts.floor.false_alarm and not facts.is_clear


def _not_repeatable(facts: Facts) -> Outcome | None:
    """Unexplained: repeats of one command differ, so that no effect of the commands is all of it.

    A set that removes most of the difference keeps its name: it is not all, and the report says so. What
    differs between the repeats belongs to the difference: counted as noise it would excuse itself. A set with
    a ripple makes repeats differ, too, since each of them begins with the wheel at another angle.
    """
    if facts.chosen is not None and any(CATALOGUE[name].follows_angle for name in facts.chosen.names):
        return None
    reason, is_most = _something_random(facts), facts.removed_of_all >= THRESHOLDS.most_of_it
    return _unexplained(facts, reason) if reason and not is_most else None


def _something_random(facts: Facts) -> str:
    """Return that repeats differ by more than noise; empty if they do not."""
    if facts.floor.repeatable:
        return ""
    return (
        "repeats of one command differ far more than neighbouring samples do: something random acts, which "
        "no effect describes"
    )


def _law_fits_better(facts: Facts) -> Outcome | None:
    """Unexplained: the wheel law fitted again does better than formulas of effects may err."""
    outcome = _unexplained(facts)
    return outcome if outcome.reasons else None


def _free_term_is_better(facts: Facts) -> Outcome | None:
    """Unexplained: a smooth function predicts runs that are left out better than the formulas may err.

    A set that removes most of the difference keeps its name: it is not all, and the report says so. No gap
    where the whole residual is what a right model leaves: of that, a smooth function describes a part, too.
    """
    reason = _more_than_named(facts)
    if not reason or facts.removed >= THRESHOLDS.most_of_it:
        return None
    return Outcome("no_gap", (reason,)) if may_be_noise(facts) else _unexplained(facts, reason)


def _more_than_named(facts: Facts) -> str:
    """Return by how much a smooth function does better than the chosen set; empty if formulas may err so."""
    if facts.free is None or facts.chosen is None or facts.free.score >= facts.chosen.score - facts.allowed:
        return ""
    return (
        f"a smooth function of command, speed and time predicts runs that are left out better than "
        f"{' + '.join(facts.chosen.names)} does, by {facts.chosen.score - facts.free.score:.0f} in -2 log "
        f"density where formulas may err by {facts.allowed:.0f}: whatever changed, it is not only that"
    )


def _size_in_doubt(facts: Facts) -> Outcome | None:
    """No gap or unexplained: the runs disagree about an effect of the set, which may as well be none."""
    if not facts.doubtful:
        return None
    reason = f"{' + '.join(facts.doubtful)}: the runs disagree about the size, which may as well be none"
    return Outcome("no_gap" if may_be_noise(facts) else "unexplained", (reason,))


RULES: Final[tuple[Rule, ...]] = (
    _far_apart,
    _not_significant,
    _of_one_sequence,
    _within_own_error,
    _inadequate,
    _too_small,
    _harmful,
    _not_repeatable,
    _law_fits_better,
    _free_term_is_better,
    _size_in_doubt,
)
"""What objects to naming the chosen set; the first objection decides."""


def apply_rules(facts: Facts) -> Outcome:
    """Return the first objection; without any the set is named, or ambiguous if other causes do as well.

    A tie between forms of the same causes leaves the verdict as it is.
    """
    for rule in RULES:
        outcome = rule(facts)
        if outcome is not None:
            return outcome
    more = tuple(filter(None, (_left_over(facts), _more_than_named(facts), _something_random(facts))))
    verdict: Verdict = "ambiguous" if len({one.causes for one in facts.tied}) > 1 else "named"
    return Outcome(verdict, more)


def _unexplained(facts: Facts, *reasons: str) -> Outcome:
    """Return the verdict; that the wheel law fitted again beats every set is said beside other reasons."""
    if facts.law and facts.chosen and facts.law.score < facts.chosen.score - facts.law_allowed:
        law = (
            "the wheel law fitted again explains these logs better than any set of effects: "
            "fit it again (python -m sysid.fit) before looking for effects"
        )
        reasons = (*reasons, law)
    return Outcome("unexplained", reasons)
