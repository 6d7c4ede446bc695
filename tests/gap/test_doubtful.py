"""Which effects of a set may as well be none."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sysid.gap.search import scores


@pytest.mark.parametrize(
    ("name", "reaches_neutral", "is_doubtful"),
    [
        ("coulomb_friction", True, True),
        ("torque_ripple", True, False),
        ("speed_gain", True, True),
        ("acceleration_limit", False, False),
    ],
)
def test_what_the_logs_need_is_there_at_a_vague_size_if_that_is_not_in_proportion_to_it(
    monkeypatch: pytest.MonkeyPatch, name: str, reaches_neutral: bool, is_doubtful: bool
) -> None:
    """In a mean of repeats, each with a phase of its own, the size of a ripple is that of a variance.

    A limit is neutral beyond its range.
    """
    monkeypatch.setattr(scores, "interval_ends", lambda *_: (np.array([-0.5]), np.array([1.5])))
    monkeypatch.setattr(scores, "_surely_there", lambda *_: True)
    candidate = SimpleNamespace(
        owners=(name,),
        start=lambda: np.zeros(1),
        decisive=lambda _: (True,),
        coordinates=(SimpleNamespace(effect=name, reaches_neutral=reaches_neutral),),
    )
    fitted: Any = SimpleNamespace(names=(name,), candidate=candidate)
    problem: Any = SimpleNamespace(base=None, knows_all=False)
    assert scores.doubtful(problem, fitted, 1.0) == ((name,) if is_doubtful else ())
