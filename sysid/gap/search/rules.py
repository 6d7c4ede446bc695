"""The rules of the decision: each looks at the same facts and gives a verdict with its reasons, or passes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final, TypeAlias

from sysid.gap.result import Verdict
from sysid.gap.search.scores import ScoredSet
from sysid.gap.search.thresholds import Thresholds


@dataclass(frozen=True, eq=False)
class Facts:
    """What the rules know of a study; from `chosen` on, only where the search for a set was made."""

    trusted: bool
    """Whether it is known what a right model leaves (`sysid.gap.search.adequacy.Floor`)."""
    repeatable: bool
    """Whether repeats of one command differ by no more than noise."""
    p_value: float
    """Probability that a right model differs as much from the logs."""
    p_misfit: float
    """The same by the whole residual alone, whatever effects could remove."""
    noise_ratio: float
    """Mean squared error of the model as it is over single samples, in noise variances."""
    inflation: float
    """Residual variance of the best fit relative to the expected noise variance (at least 1)."""
    judged: tuple[ScoredSet, ...]
    """All sets that were fitted, the empty one too; best score first."""
    chosen: ScoredSet | None = None
    """The best set of the size that the logs support."""
    tied: tuple[ScoredSet, ...] = ()
    """Sets that explain the logs as well as the chosen one, which comes first."""
    law: ScoredSet | None = None
    """The wheel law fitted again, where that was tried."""
    adequate: bool = False
    """Whether the chosen set leaves what noise allows, or little beside what it explains."""
    removed: float = 0.0
    """Share of the squared difference above the noise that the chosen set removes."""
    raises_rms: bool = False
    """Whether the chosen set raises the plain error on the validation runs."""
    doubtful: tuple[str, ...] = ()
    """Effects of the chosen set of which no parameter is surely away from neutral."""
    frequency: Mapping[str, float] = field(default_factory=dict)
    """Effect of the chosen set -> share of resamples in which it is chosen."""

    @property
    def name(self) -> str:
        """The chosen set in a note."""
        return " + ".join(self.chosen.names) if self.chosen else ""

    def law_is_better(self, thresholds: Thresholds) -> bool:
        """Return whether the wheel law fitted again beats every set by more than a tie.

        Args:
            thresholds: say how much a tie is.
        """
        if self.law is None or self.chosen is None:
            return False
        return self.law.score < self.chosen.score - thresholds.tie_sigmas**2


@dataclass(frozen=True)
class Outcome:
    """A verdict and the reasons for it, in sentences."""

    verdict: Verdict
    reasons: tuple[str, ...] = ()


Rule: TypeAlias = Callable[[Facts, Thresholds], Outcome | None]

_LAW_IS_BETTER: Final = (
    "the wheel law fitted again explains these logs better than any set of effects: "
    "fit it again (python -m sysid.fit) before looking for effects"
)


def _far_apart(facts: Facts, thresholds: Thresholds) -> Outcome | None:
    """Unexplained: nothing says how large the model's own error is, and the residual is plainly no noise.

    An error that was measured on these very logs contains any gap, and so excuses none.
    """
    if facts.trusted or facts.noise_ratio <= thresholds.above_noise:
        return None
    if facts.removed >= thresholds.least_removed:
        return None
    reason = (
        f"the difference is {math.sqrt(facts.noise_ratio):.2g} times the noise (rms), and no set of effects "
        f"removes {thresholds.least_removed:.0%} of its square"
    )
    return _unexplained(facts, thresholds, reason)


def _nothing_significant(facts: Facts, thresholds: Thresholds) -> Outcome | None:
    """No gap: neither the best effect nor the whole residual is more than chance allows."""
    return Outcome("no_gap") if facts.p_value > thresholds.false_alarm else None


def _nothing_fitted(facts: Facts, _: Thresholds) -> Outcome | None:
    """Unexplained: there is a gap, and no effect could be fitted to it."""
    return Outcome("unexplained") if facts.chosen is None else None


def _too_small(facts: Facts, thresholds: Thresholds) -> Outcome | None:
    """No gap: the chosen set is significant and removes next to nothing."""
    if not facts.adequate or facts.removed >= thresholds.least_removed:
        return None
    reason = (
        f"{facts.name} would be significant (p = {facts.p_value:.2g}), but removes only "
        f"{max(facts.removed, 0.0):.0%} of the difference above the noise, which the model's own error can "
        "be as well"
    )
    return Outcome("no_gap", (reason,))


def _harmful(facts: Facts, thresholds: Thresholds) -> Outcome | None:
    """Unexplained: the chosen set raises the plain error on the validation runs."""
    if not (facts.adequate and facts.raises_rms):
        return None
    reason = (
        f"{facts.name} would be significant (p = {facts.p_value:.2g}), but raises the plain difference on "
        "the validation runs"
    )
    return _unexplained(facts, thresholds, reason)


def _unrepeatable(facts: Facts, thresholds: Thresholds) -> Outcome | None:
    """Unexplained: repeats of one command differ, so that no effect of the commands is all of it."""
    if facts.repeatable or not facts.adequate:
        return None
    reason = (
        "repeats of one command differ far more than neighbouring samples do: something random acts, which "
        "no effect describes"
    )
    return _unexplained(facts, thresholds, reason)


def _law_fits_better(facts: Facts, thresholds: Thresholds) -> Outcome | None:
    """Unexplained: no effect is missing but a better fit of the wheel law."""
    return _unexplained(facts, thresholds) if facts.law_is_better(thresholds) else None


def _inadequate(facts: Facts, _: Thresholds) -> Outcome | None:
    """Unexplained: the chosen set leaves more than noise and an imperfect formula can."""
    return None if facts.adequate else Outcome("unexplained")


def _size_in_doubt(facts: Facts, thresholds: Thresholds) -> Outcome | None:
    """No gap or unexplained: the runs disagree about an effect of the set, which may as well be none."""
    if not facts.doubtful:
        return None
    reason = f"{' + '.join(facts.doubtful)}: the runs disagree about the size, which may as well be none"
    is_noise = facts.trusted and facts.p_misfit > thresholds.false_alarm
    return Outcome("no_gap" if is_noise else "unexplained", (reason,))


def _explained(facts: Facts, _: Thresholds) -> Outcome | None:
    """Named, or ambiguous where other sets explain the logs as well."""
    return Outcome("ambiguous" if len(facts.tied) > 1 else "named")


RULES: Final[tuple[Rule, ...]] = (
    _far_apart,
    _nothing_significant,
    _nothing_fitted,
    _too_small,
    _harmful,
    _unrepeatable,
    _law_fits_better,
    _inadequate,
    _size_in_doubt,
    _explained,
)
"""In this order; the first that gives an outcome decides. The last always does."""


def apply_rules(facts: Facts, thresholds: Thresholds) -> Outcome:
    """Return the outcome of the first rule that gives one.

    Args:
        facts: of the study.
        thresholds: of the decision.
    """
    outcomes = (rule(facts, thresholds) for rule in RULES)
    return next(outcome for outcome in outcomes if outcome is not None)


def _unexplained(facts: Facts, thresholds: Thresholds, *reasons: str) -> Outcome:
    """Return the verdict; that the law fits better is said beside any other reason."""
    if facts.law_is_better(thresholds):
        reasons = (*reasons, _LAW_IS_BETTER)
    return Outcome("unexplained", reasons)
