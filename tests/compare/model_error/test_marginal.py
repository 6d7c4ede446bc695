"""White values beside factors that nobody knows."""

from __future__ import annotations

import numpy as np

from sysid.compare.model_error import Marginal

RNG = np.random.default_rng(0)
FACTORS = RNG.standard_normal((12, 3)) * [5.0, 1.0, 0.1]


def test_values_with_unknown_factors_become_white() -> None:
    root = Marginal(FACTORS).of(np.eye(12))
    covariance = np.eye(12) + FACTORS @ FACTORS.T
    np.testing.assert_allclose(root @ covariance @ root.T, np.eye(12), atol=1e-12)


def test_the_inverse_gives_the_values_back() -> None:
    marginal, values = Marginal(FACTORS), RNG.standard_normal(12)
    np.testing.assert_allclose(marginal.inverse(marginal.of(values)), values)
    np.testing.assert_allclose(marginal.of(values), marginal.of(values[:, None])[:, 0])


def test_without_factors_values_stay() -> None:
    values = RNG.standard_normal(12)
    np.testing.assert_array_equal(Marginal(np.zeros((12, 0))).of(values), values)
