"""How well a mean square over command sequences is known."""

import numpy as np
import pytest

from sysid.compare.model_error.freedom import freedom_of_each


def test_mean_squares_of_normal_values_have_as_many_degrees_of_freedom() -> None:
    rng = np.random.default_rng(0)
    for values in (3, 30):
        squares = np.mean(rng.standard_normal((4000, values)) ** 2, axis=1)
        assert freedom_of_each(squares) == pytest.approx(values, rel=0.1)


def test_what_nothing_tells_is_little() -> None:
    assert freedom_of_each(()) == freedom_of_each([1.3]) == freedom_of_each([0.0, 0.0]) == 2.0
