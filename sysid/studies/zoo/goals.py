"""The headline metrics of a run, each with its target and whether its interval is on the right side of it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from sysid.studies.score import Metric, size_of
from sysid.studies.zoo.outcome import Outcome
from sysid.studies.zoo.tables import is_found, is_visible, of_kind, share, signal_of

Reached = Literal["reached", "missed", "open", "-"]
"""The whole interval is on the right side of the target; on the wrong one; on both; there is none."""


@dataclass(frozen=True)
class Goal(Metric):
    """A metric beside its target."""

    target: str
    reached: Reached

    def row(self) -> tuple[str, str, str, str, str]:
        """Return name, value with interval, number of cases, target and whether it is reached."""
        if math.isnan(self.value):
            said = "-"
        elif math.isnan(self.low):
            said = f"{self.value:.3f}"
        else:
            said = f"{100 * self.value:.1f} % ({100 * self.low:.1f} to {100 * self.high:.1f})"
        return self.name, said, str(self.count), self.target, self.reached


GOAL_HEAD: Final = ("metric", "value (95 % interval)", "cases", "target", "")


def goals(outcomes: Sequence[Outcome]) -> tuple[Goal, ...]:
    """Return the headline metrics of a run, each with its target."""
    found: list[Goal] = []
    for level in ("bench", "robot"):
        singles = of_kind(outcomes, "single", "twin", level=level)
        several = of_kind(outcomes, "pair", "triple", level=level)
        outside = of_kind(outcomes, "near_outsider", "far_outsider", level=level)
        visible = [o for o in (*singles, *several) if is_visible(o)]
        twins = of_kind(singles, "twin")
        clear, closure = (0.95, 0.95) if level == "bench" else (0.85, 0.8)
        found += [
            at_least(f"{level}: clear and gross singles found", map(is_found, _seen(singles)), clear),
            at_least(f"{level}: weak singles found", map(is_found, _weak(singles)), 0.8),
            at_least(
                f"{level}: clear and gross pairs and triples found", map(is_found, _seen(several)), 0.85
            ),
            at_most(f"{level}: clear and gross with a false name", map(_is_false, visible), 0.02),
            at_most(f"{level}: false alarms", map(_is_alarm, of_kind(outcomes, "quiet", level=level)), 0.05),
            at_most(f"{level}: names for what has none", (bool(o.claims) for o in outside), 0.02),
            at_most(f"{level}: twins named alone", (o.verdict == "named" for o in twins), 0.0),
            _median(f"{level}: median closure of clear and gross", (o.closure for o in visible), closure),
            _median(
                f"{level}: median closure beside the logs of the fit",
                (o.closure_beside_fit for o in visible),
                closure,
            ),
        ]
    inside = [held for outcome in outcomes for _, _, held in outcome.covered()]
    untestable = of_kind(outcomes, "untestable")
    return (
        *found,
        at_least("90 % intervals that hold the truth", inside, 0.85),
        at_least("untestable: right", map(is_found, untestable), None),
        at_most("errors", (o.word == "error" for o in outcomes), 0.0),
    )


def _seen(outcomes: Iterable[Outcome]) -> list[Outcome]:
    return [outcome for outcome in outcomes if is_visible(outcome)]


def _weak(outcomes: Iterable[Outcome]) -> list[Outcome]:
    return [outcome for outcome in outcomes if size_of(signal_of(outcome)) == "weak"]


def _is_false(outcome: Outcome) -> bool:
    return outcome.word in ("wrong", "overclaimed")


def _is_alarm(outcome: Outcome) -> bool:
    return outcome.word == "false alarm"


def at_least(name: str, hits: Iterable[bool], least: float | None) -> Goal:
    """Return the share of `hits` by its name, which should be `least` or more; None: no target."""
    got = share(hits)
    target = "none" if least is None else f">= {100 * least:g} %"
    reached: Reached = "-"
    if least is not None and got.count:
        reached = "reached" if got.low >= least else "missed" if got.high < least else "open"
    return Goal(name, got.value, got.low, got.high, got.count, target, reached)


def at_most(name: str, hits: Iterable[bool], most: float) -> Goal:
    """Return the share of `hits` by its name, which should be `most` or less.

    No interval of a finite number of cases is within a target of 0: there, no hit at all reaches it.
    """
    got = share(hits)
    target = f"<= {100 * most:g} %"
    reached: Reached = "-"
    if got.count:
        good = got.high <= most if most else got.hits == 0
        reached = "reached" if good else "missed" if got.low > most or not most else "open"
    return Goal(name, got.value, got.low, got.high, got.count, target, reached)


def _median(name: str, values: Iterable[float], least: float) -> Goal:
    known = [value for value in values if math.isfinite(value)]
    value = float(np.median(known)) if known else math.nan
    reached: Reached = "-" if not known else "reached" if value >= least else "missed"
    return Goal(name, value, math.nan, math.nan, len(known), f">= {least:g}", reached)
