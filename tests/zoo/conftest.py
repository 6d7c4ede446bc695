"""Outcomes of cases that nobody ran."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from sysid.studies.zoo.cases.case import Case, Hidden
from sysid.studies.zoo.outcome import Outcome

MakeOutcome = Callable[..., Outcome]


@pytest.fixture
def outcome() -> MakeOutcome:
    """Return a function that makes an outcome: what was hidden, the kind, and what was said.

    `said` is a verdict, a set of names joined by " + ", or several of them joined by " | ". Other fields of
    the case or the outcome may be given by their names.
    """

    def make(hidden: str = "", said: str = "no_gap", kind: str = "", **given: Any) -> Outcome:
        names = tuple(hidden.split(" + ")) if hidden else ()
        of_case = {key: given.pop(key) for key in list(given) if key in Case.__dataclass_fields__}
        known = {
            "seed": 1,
            "level": "bench",
            "kind": kind or {0: "quiet", 1: "single", 2: "pair", 3: "triple"}[len(names)],
            "family": "pi",
            "plan": "steps",
            "layout": "standard",
            "hidden": tuple(Hidden(name, "fixed", {"size": 2.0}) for name in names),
            "signal": 3.0 if hidden or kind else 0.0,
        }
        case = Case(**(known | of_case))
        if said in ("no_gap", "unexplained", "error"):
            return Outcome(case, said, **given)
        sets = tuple(tuple(names.split(" + ")) for names in said.split(" | "))
        verdict = "named" if len(sets) == 1 else "ambiguous"
        return Outcome(case, verdict, sets[0], sets, **({"p_value": 1e-4} | given))

    return make
