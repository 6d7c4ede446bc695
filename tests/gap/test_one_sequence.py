"""What a single command sequence of a robot may show by chance."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sysid.gap.search.one_sequence import is_of_one_sequence, least_falls

SIZE = 10
"""Values of each run."""


def a_problem(groups: tuple[str, ...], **changes: bool) -> Any:
    """Return a problem of one run of each of some command sequences, which are those of the fit."""
    return SimpleNamespace(
        knows_all=changes.get("knows_all", True),
        same_commands=changes.get("same_commands", True),
        size=SIZE * len(groups),
        observations=SimpleNamespace(
            blocks=[SimpleNamespace(situation=index) for index in range(len(groups))],
            situations=[SimpleNamespace(group=group) for group in groups],
        ),
        whitener=SimpleNamespace(slices=[slice(SIZE * k, SIZE * (k + 1)) for k in range(len(groups))]),
    )


def fits(*falls: float) -> tuple[Any, Any]:
    """Return the fit of no effect and that of one which lowers the cost of each run by so much."""
    before = np.repeat([*map(abs, falls)], SIZE)
    after = before - np.repeat(falls, SIZE) / SIZE
    return SimpleNamespace(residual=np.sqrt(before)), SimpleNamespace(residual=np.sqrt(after))


@pytest.mark.parametrize(
    ("falls", "of_one"),
    [
        ((30.0, 4.0, 3.0), True),
        ((30.0, 12.0, 9.0), False),
        ((80.0, 1.0, -2.0), False),
        ((3.0, 3.0, 3.0), True),
    ],
)
def test_a_set_explains_more_than_chance_without_its_best_sequence_or_far_more_with_it(
    falls: tuple[float, ...], of_one: bool
) -> None:
    base, fitted = fits(*falls)
    assert is_of_one_sequence(a_problem(("a", "b", "c")), base, fitted, 20.0, 70.0) == of_one


def test_repeats_are_compared_with_the_same_runs_of_the_fit() -> None:
    base, fitted = fits(30.0, 30.0)
    assert is_of_one_sequence(a_problem(("a", "a")), base, fitted, 20.0, 70.0)
    assert not is_of_one_sequence(a_problem(("a", "b")), base, fitted, 20.0, 70.0)


@pytest.mark.parametrize("other", ["knows_all", "same_commands"])
def test_it_is_asked_of_a_robot_that_drives_the_commands_of_its_fit(other: str) -> None:
    base, fitted = fits(30.0, 4.0, 3.0)
    problem = a_problem(("a", "b", "c"), **{other: False})
    assert not is_of_one_sequence(problem, base, fitted, 20.0, 70.0)


def test_an_effect_that_acts_in_one_sequence_alone_needs_far_more() -> None:
    problem: Any = a_problem(("a", "b"))
    everywhere: Any = SimpleNamespace(effect="speed_gain", change=np.ones(2 * SIZE))
    here: Any = SimpleNamespace(effect="body_speed_limit", change=np.repeat([1.0, 0.0], SIZE))
    falls = least_falls(problem, [everywhere, here], 20.0, 70.0)
    assert falls == {"speed_gain": 40.0, "body_speed_limit": 70.0}
