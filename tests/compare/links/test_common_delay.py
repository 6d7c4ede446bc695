"""What the delays of many changes have in common, from how likely each delay of each change is."""

from __future__ import annotations

import numpy as np
import pytest

from mecanum_env.units import FloatArray
from sysid.compare.links.changes import GRID_S, Change
from sysid.compare.links.common_delay import EVIDENCE, CommonDelay, evidence, student_weights, without_trend

SURE_S = 0.004


def likelihood(delay_s: FloatArray) -> FloatArray:
    """Return the log likelihood of changes whose delays the logs show to within 4 ms."""
    return np.asarray(-0.5 * ((GRID_S - delay_s[:, None]) / SURE_S) ** 2)


def test_the_common_delay_and_the_spread_are_those_of_greatest_likelihood() -> None:
    true = 0.2 + 0.03 * np.random.default_rng(0).standard_normal(60)
    found = CommonDelay.of(likelihood(true))
    assert found.mean_s == pytest.approx(0.2, abs=0.01)
    assert found.spread_s == pytest.approx(0.03, rel=0.4)
    assert evidence(likelihood(true)) > EVIDENCE


def test_a_delay_that_the_logs_do_not_show_is_the_common_one() -> None:
    mean, deviation = CommonDelay(0.2, 0.03).posterior_s(np.zeros((1, GRID_S.size)))
    assert mean == pytest.approx(0.2, abs=0.005)
    assert deviation > 0.02


def test_one_delay_has_no_evidence_of_a_spread() -> None:
    assert evidence(likelihood(np.full(60, 0.1))) < 0.0
    assert evidence(likelihood(np.linspace(0.0, 0.4, 5))) == 0.0  # too few


def test_what_goes_with_the_size_of_a_change_is_taken_off() -> None:
    sizes = np.linspace(10.0, 100.0, 20)
    changes = [Change(0, float(i), 0.0, float(size)) for i, size in enumerate(sizes)]
    grows = likelihood(0.1 + 0.001 * sizes)
    assert evidence(grows) > EVIDENCE
    assert evidence(without_trend(grows, changes)) < EVIDENCE


def test_the_weights_of_a_delay_are_probabilities() -> None:
    np.testing.assert_allclose(student_weights(0.02).sum(axis=1), 1.0)
