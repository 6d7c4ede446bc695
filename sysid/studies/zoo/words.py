"""The words for an outcome: right, rightly ambiguous, abstained, wrong and the others, one for each case."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Literal

from sysid.studies.zoo.outcome import ERROR, Outcome

Word = Literal[
    "right",
    "rightly ambiguous",
    "overclaimed",
    "vague",
    "abstained",
    "missed",
    "wrong",
    "quiet",
    "false alarm",
    "false name",
    "error",
]

WORDS: Final[Mapping[Word, str]] = MappingProxyType(
    {
        "right": "the hidden set was named; a change without a name was called unexplained; what logs cannot "
        "show was said to be untestable, or not claimed",
        "rightly ambiguous": "the hidden set is among the candidates",
        "overclaimed": "the hidden effects were named with others that are not there",
        "vague": "only some of the hidden effects were named, or the candidates contain some of them",
        "abstained": "unexplained, though the hidden effects have names",
        "missed": "no gap, though something was hidden",
        "wrong": "no hidden effect was named, or one of several beside one that is not there",
        "quiet": "nothing was hidden, and no gap was found",
        "false alarm": "nothing was hidden, and a gap was found",
        "false name": "an effect was named for a change that no name covers",
        "error": "the fit or the study ended with an error",
    }
)
"""Word -> what it says of a case."""

FOUND: Final[frozenset[Word]] = frozenset({"right", "rightly ambiguous"})
"""The words of a hidden set that was found."""


def word_of(outcome: Outcome) -> Word:
    """Return the word for an outcome."""
    if outcome.verdict == ERROR:
        return "error"
    kind = outcome.case.kind
    if kind == "quiet":
        return "quiet" if outcome.verdict == "no_gap" else "false alarm"
    if kind in ("near_outsider", "far_outsider"):
        if outcome.claims:
            return "false name"
        return "missed" if outcome.verdict == "no_gap" else "right"
    if kind == "untestable" and (
        outcome.verdict == "no_gap" or (outcome.verdict == "unexplained" and outcome.said_untestable)
    ):
        return "right"
    if outcome.verdict == "no_gap":
        return "missed"
    return _word_of_claims(outcome) if outcome.claims else "abstained"


def _word_of_claims(outcome: Outcome) -> Word:
    """Return the word for the sets that a verdict offers, at least one, against the hidden set."""
    hidden, claims = outcome.hidden, outcome.claims
    if hidden in claims:
        return "right" if len(claims) == 1 else "rightly ambiguous"
    if all(claim > hidden for claim in claims):
        return "overclaimed"
    if all(claim < hidden for claim in claims) or (len(claims) > 1 and any(c & hidden for c in claims)):
        return "vague"
    return "wrong"
