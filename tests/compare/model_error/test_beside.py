"""What repeats in the logs of a fit differ by, beside new logs."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sysid.compare.model_error.beside import Beside, contrasts_of

VALUES = 20_000


def beside(repeats: int) -> Beside:
    """Return white repeats, each less the mean of the others, beside a block of variance 4."""
    white = np.random.default_rng(repeats).standard_normal((repeats, VALUES))
    others = (white.sum(axis=0) - white) / (repeats - 1)
    deviations = (white - others) / np.sqrt(1.0 + 1.0 / (repeats - 1))
    block: Any = SimpleNamespace(value=np.zeros(VALUES), weight=np.full(VALUES, 0.25))
    return Beside(block, np.zeros(VALUES), deviations, np.ones(deviations.shape))


@pytest.mark.parametrize("repeats", [2, 3, 5])
def test_contrasts_of_repeats_are_independent_with_the_variance_of_the_difference(repeats: int) -> None:
    contrasts = np.stack([one[0] for one in contrasts_of([beside(repeats)])])
    assert contrasts.shape == (repeats - 1, VALUES)
    np.testing.assert_allclose(contrasts @ contrasts.T / VALUES, 4.0 * np.eye(repeats - 1), atol=0.2)


def test_a_sequence_with_fewer_repeats_tells_nothing_more() -> None:
    contrasts = contrasts_of([beside(2), beside(4)])
    assert [bool(np.any(one[0])) for one in contrasts] == [True, False, False]
    assert all(np.any(one[1]) for one in contrasts)
