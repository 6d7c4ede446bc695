"""The words for an outcome: right, rightly ambiguous, abstained, wrong and the others, one for each case."""

from __future__ import annotations

from sysid.studies import score
from sysid.studies.zoo.outcome import Outcome


def word_of(outcome: Outcome) -> str:
    """Return the word for an outcome, one of `sysid.studies.score.WORDS`."""
    return score.word_of(
        outcome.case.kind, outcome.hidden, outcome.verdict, outcome.claims, outcome.said_untestable
    )
