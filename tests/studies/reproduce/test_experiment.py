"""The whole experiment in small: identities of its figures, determinism, progress."""

import math

import numpy as np
import pytest

from mecanum_env.law import WheelLaw
from mecanum_env.parallel import Workers
from sysid.studies.reproduce import published
from sysid.studies.reproduce.contenders import COMPARED, OURS, QUICK
from sysid.studies.reproduce.data import record_data_sets
from sysid.studies.reproduce.experiment import STAGES, reproduce
from sysid.studies.reproduce.pages import reproduction_json
from sysid.studies.reproduce.prediction import model_step, pooled_rms, rms_error


def test_laws_of_unit_gain_have_no_steady_state_error(quick):
    for name in ("output-error", "kkt-improved", "exhaustive", "one-step"):
        assert abs(quick.models[name].relative_error) <= 1e-12


def test_after_one_second_what_is_left_is_the_slowest_pole(quick):
    law, model = quick.estimates[OURS].law, quick.models[OURS]
    assert model.relative_error_after_1_s < 0.0
    assert abs(model.relative_error_after_1_s) < 10.0 * abs(law.poles[0]) ** 120


def test_no_method_is_nearer_to_the_fitted_steps(quick):
    rms = pooled_rms(quick.errors, "fit")
    assert min(rms, key=rms.__getitem__) == OURS


def test_output_error_simulates_the_test_data_to_little_more_than_the_noise(quick):
    assert pooled_rms(quick.errors, "test")[OURS] < 1.5 * quick.sigma_rpm
    assert pooled_rms(quick.errors, "trial")[OURS] < 2.0 * quick.sigma_rpm


def test_errors_are_those_of_the_estimator(quick, data):
    found = quick.estimates[OURS]
    assert rms_error(found.law, data.fit_runs) == pytest.approx(found.rms_rpm, rel=1e-9)


def test_every_data_set_is_compared(quick):
    roles = [errors.role for errors in quick.errors]
    assert {role: roles.count(role) for role in set(roles)} == {"fit": 4, "test": 13, "beyond": 1, "trial": 5}
    assert all(set(errors.rms_rpm) == set(COMPARED) for errors in quick.errors)


def test_the_target_is_the_papers_robot(quick):
    target = quick.target
    assert target.speeds_rpm == published.TEST_STEPS_RPM
    assert np.mean(target.true_relative_error) == pytest.approx(published.STEADY_ERROR["target"], rel=0.1)
    assert np.mean(target.true_rise_s) == pytest.approx(published.RISE_S["target"], abs=0.005)
    assert np.mean(target.true_settling_s) == pytest.approx(published.SETTLING_S["target"], abs=0.01)


def test_the_ceiling_is_found_from_the_step_beyond(quick):
    assert quick.fitted_ceiling_rpm == pytest.approx(published.CEILING_RPM, rel=0.01)
    free, limited = (shown.models_rpm[OURS][-1] for shown in (quick.beyond, quick.beyond_limited))
    assert free == pytest.approx(published.BEYOND_RPM, rel=1e-3)
    assert limited == pytest.approx(published.CEILING_RPM, rel=1e-3)


def test_costs_count_every_method_and_diverged_search(quick):
    assert set(COMPARED) <= set(quick.costs)
    for cost in quick.costs.values():
        assert cost.mean_s > 0.0
        assert 0.0 < cost.peak_memory_mib < 200.0
        assert 0 <= cost.diverged <= cost.repeats
    assert quick.costs["exhaustive"].mean_iterations > 1000


def test_the_robot_drives_the_papers_five(quick):
    assert [moved.name for moved in quick.robot] == list(published.ROBOT_LOSS)
    for moved in quick.robot:
        assert moved.loss < moved.paper_loss  # friction and load are not simulated
        assert moved.body[-1] == pytest.approx(0.0, abs=0.01 * moved.commanded)


def test_an_unstable_law_has_figures_but_no_steady_state():
    law = WheelLaw(2.0, -0.8, -0.15, 0.05, 0.05, 0.0, 1 / 120)
    assert not law.is_stable
    step = model_step(law)
    assert math.isnan(step.relative_error)
    assert not step.stable


def test_every_stage_is_told_once(quick, quick_stages):
    assert quick.seed == 0
    assert sorted(quick_stages) == sorted(STAGES)


@pytest.fixture
def again(quick, monkeypatch):
    """Return a second run on data recorded anew, without measuring times and memory, which differ."""
    record_data_sets.cache_clear()
    monkeypatch.setattr("sysid.studies.reproduce.experiment.measure_costs", lambda *_: quick.costs)
    return reproduce(0, QUICK, workers=Workers(jobs=1))


def without_cost(found):
    record = reproduction_json(found)
    del record["costs"]
    record["comparisons"] = [c for c in record["comparisons"] if c["section"] != "cost"]
    return record


def test_equal_seeds_give_equal_figures(quick, again):
    assert without_cost(quick) == without_cost(again)


def test_the_seed_moves_the_recordings():
    one, other = (record_data_sets(seed).trials[0].record.speed_rpm for seed in (0, 1))
    assert not np.array_equal(one, other)
