"""The models that a model's stated uncertainty allows."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.model import Model, paper_model
from mecanum_env.simulator import replay_bench
from sysid.compare.model_error import as_fitted, covariance_of, plausible_models, with_adopted


def test_effects_that_were_fitted_with_the_law_stay_within_what_can_be_simulated() -> None:
    base: Model = paper_model()
    model = base.with_effect("backlash", gap_deg=1.0).with_effect("command_latency", delay_s=0.02)
    names = [*COEFFICIENTS, "backlash.gap_deg", "command_latency.delay_s"]
    spread = np.array([*np.full(6, 1e-6), 30.0, 0.01])
    stated = {"names": names, "covariance": np.diag(spread**2).tolist()}
    found = plausible_models(replace(model, uncertainty={"joint": stated}))
    assert len(found) == len(names)
    for other in found:
        replay_bench(other, np.arange(50) * 0.01, np.full(50, 60.0))
    delays = {round(other.effects["command_latency"]["delay_s"], 6) for other in found}
    assert delays > {0.02}


def test_an_effect_that_a_study_added_is_varied_beside_the_law_of_the_fit() -> None:
    model: Model = paper_model().with_effect("speed_gain", gain=0.9)
    of_law = {"names": list(COEFFICIENTS), "covariance": (1e-12 * np.eye(6)).tolist()}
    stated = replace(model, uncertainty={"wheel": of_law})
    added = with_adopted(stated, ["speed_gain.gain"], np.array([[0.02**2]]), ["speed_gain"], [])
    gains = [other.effects["speed_gain"]["gain"] for other in plausible_models(added)]
    assert sorted(gains)[:6] == [0.9] * 6
    assert sorted(gains)[6] == pytest.approx(0.92) or sorted(gains)[0] == pytest.approx(0.88)


def test_a_study_replaces_what_was_known_of_the_effects_that_it_fits_again() -> None:
    model = paper_model().with_effect("speed_gain", gain=0.9).with_effect("backlash", gap_deg=2.0)
    names = ["speed_gain.gain", "backlash.gap_deg"]
    first = with_adopted(model, names, np.diag([0.01, 4.0]), ["speed_gain", "backlash"], ["backlash"])
    again = with_adopted(first, ["backlash.gap_deg"], np.array([[1.0]]), ["backlash"], [])
    assert again.uncertainty["adopted"] == {
        "names": names,
        "covariance": [[0.01, 0.0], [0.0, 1.0]],
        "new": [],
    }


def test_the_logs_of_the_fit_are_seen_without_what_came_later() -> None:
    model = paper_model().with_effect("speed_gain", gain=0.9).with_effect("backlash", gap_deg=2.0)
    added = with_adopted(model, [], np.zeros((0, 0)), ["speed_gain", "backlash"], ["backlash"])
    assert set(as_fitted(added).effects) == {"speed_gain"}


def test_parameters_without_a_known_width_are_left_out_and_the_others_keep_their_correlation() -> None:
    intervals = {"a.x": (0.0, 2.0 * 1.6448536), "a.y": (0.0, math.inf), "b.z": (1.0, 1.0 + 4.0 * 1.6448536)}
    place = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.0], [0.5, 0.0, 1.0]])
    names, covariance = covariance_of(intervals, ["a.x", "a.y", "b.z"], place, 0.9)
    assert names == ["a.x", "b.z"]
    np.testing.assert_allclose(covariance, [[1.0, 1.0], [1.0, 4.0]], rtol=1e-6)
