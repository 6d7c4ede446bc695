"""Which effects of a set may as well be none."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sysid.gap.search import scores


@pytest.mark.parametrize(
    ("name", "is_doubtful"), [("coulomb_friction", True), ("torque_ripple", False), ("speed_gain", True)]
)
def test_a_ripple_of_vague_size_is_there_where_the_logs_need_it(
    monkeypatch: pytest.MonkeyPatch, name: str, is_doubtful: bool
) -> None:
    """In a mean of repeats, each with a phase of its own, the size of a ripple is that of a variance."""
    monkeypatch.setattr(scores, "interval_ends", lambda *_: (np.array([-0.5]), np.array([1.5])))
    monkeypatch.setattr(scores, "_surely_there", lambda *_: True)
    candidate = SimpleNamespace(owners=(name,), start=lambda: np.zeros(1), decisive=lambda _: (True,))
    fitted: Any = SimpleNamespace(names=(name,), candidate=candidate)
    problem: Any = SimpleNamespace(base=None, knows_all=False)
    assert scores.doubtful(problem, fitted, 1.0) == ((name,) if is_doubtful else ())
