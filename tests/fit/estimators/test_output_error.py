from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mecanum_env.errors import InputError
from mecanum_env.law import LawState, WheelLaw
from sysid.fit.estimators import METHODS, Options, estimate
from sysid.studies.synthetic import step_runs

FEW = Options(starts=3)


def through_drive(runs, law, seed, *, delay_s=0.0, limit=np.inf, gain=1.0, noise=0.3):
    """The same commands with another path to the law: measured speeds simulated anew."""
    rng = np.random.default_rng(seed)
    result = []
    for run in runs:
        speed = law.simulate(gain * run.command(delay_s, limit))
        result.append(replace(run, speed_rpm=speed + noise * rng.standard_normal(len(speed))))
    return result


def test_exact_data_give_the_exact_law(paper, exact_runs):
    found = estimate(exact_runs, options=FEW)
    assert np.allclose(found.coefficients, paper.wheel.law.coefficients, atol=1e-6)
    assert found.rms_rpm < 1e-5


def test_a_run_that_starts_moving_gives_the_exact_law(paper):
    law = paper.wheel.law
    runs = [
        replace(run, initial_rpm=40.0, speed_rpm=law.simulate(run.command_rpm, LawState.steady(40.0)))
        for run in step_runs(law, np.random.default_rng(0), noise_rpm=0.0, repeats=1)
    ]
    assert np.allclose(estimate(runs, options=FEW).coefficients, law.coefficients, atol=1e-6)


def test_every_random_start_reaches_the_best_rms(noisy_runs):
    found = estimate(noisy_runs, options=Options(starts=25, first_starts="random", seed=3))
    assert found.success_share == found.stable_share == 1.0
    assert all(start.converged for start in found.starts)
    assert max(start.rms_rpm for start in found.starts) < 1.001 * found.rms_rpm


def test_the_dc_gain_is_one(noisy_runs):
    for start in estimate(noisy_runs, options=FEW).starts:
        assert abs(sum(start.coefficients) - 1.0) <= 1e-12
        assert abs(WheelLaw(*start.coefficients, 1 / 120).dc_gain - 1.0) <= 1e-12


def test_the_seed_decides_everything(noisy_runs):
    def untimed(seed):
        found = estimate(noisy_runs, options=Options(starts=4, seed=seed))
        return [replace(start, seconds=0.0) for start in found.starts]

    assert untimed(1) == untimed(1)
    assert untimed(1) != untimed(2)


def test_given_starts_replace_the_others(noisy_runs):
    unstable = (3.0, -3.5, 1.5, 0.1, 0.0, -0.1)
    found = estimate(noisy_runs, options=Options(initial=(unstable, (0.0,) * 6)))
    assert [start.kind for start in found.starts] == ["given", "given"]
    assert found.success_share == 1.0


def test_a_freed_gain_is_found(paper, noisy_runs):
    runs = through_drive(noisy_runs, paper.wheel.law, 1, gain=0.8)
    found = estimate(runs, options=Options(starts=3, unit_gain=False))
    assert found.law.dc_gain == pytest.approx(0.8, abs=1e-3)
    assert "E" in found.free
    held = estimate(runs, options=FEW)
    assert abs(np.sum(held.coefficients) - 1.0) <= 1e-12
    assert held.rms_rpm > 1.2 * found.rms_rpm  # all it can do is creep slowly towards 1


@pytest.mark.parametrize("delay_s", [0.0, 0.0123, 0.1])
def test_the_delay_is_found(paper, noisy_runs, delay_s):
    runs = through_drive(noisy_runs, paper.wheel.law, 2, delay_s=delay_s)
    found = estimate(runs, options=Options(starts=2, fit_delay=True))
    assert found.delay_s == pytest.approx(delay_s, abs=1.5e-3)
    assert found.rms_rpm == pytest.approx(0.3, rel=0.05)


def test_the_saturation_is_found(paper, noisy_runs):
    runs = through_drive(noisy_runs, paper.wheel.law, 3, limit=97.0)
    found = estimate(runs, options=Options(starts=2, fit_saturation=True))
    assert found.saturation_rpm == pytest.approx(97.0, abs=0.1)
    assert found.rms_rpm == pytest.approx(0.3, rel=0.05)


def test_delay_and_saturation_are_found_together(paper, noisy_runs):
    runs = through_drive(noisy_runs, paper.wheel.law, 4, limit=60.0, delay_s=0.0523)
    found = estimate(runs, options=Options(starts=2, fit_saturation=True, fit_delay=True))
    assert found.saturation_rpm == pytest.approx(60.0, abs=0.1)
    assert found.delay_s == pytest.approx(0.0523, abs=1.5e-3)


def test_no_ceiling_in_the_data_is_no_saturation(noisy_runs):
    found = estimate(noisy_runs, options=Options(starts=2, fit_saturation=True))
    assert found.saturation_rpm == np.inf
    assert "saturation_rpm" not in found.free


def test_outliers_hardly_move_the_huber_fit(paper, noisy_runs):
    rng = np.random.default_rng(5)
    spoilt = []
    for run in noisy_runs:
        speed = run.speed_rpm.copy()
        speed[rng.choice(len(speed), 8, replace=False)] += 60.0
        spoilt.append(replace(run, speed_rpm=speed))
    truth = paper.wheel.law.simulate(np.full(120, 100.0))
    errors = []
    for loss in ("huber", "linear"):
        law = estimate(spoilt, options=Options(starts=2, loss=loss)).law
        errors.append(np.max(np.abs(law.simulate(np.full(120, 100.0)) - truth)))
    assert errors[0] < 1.0
    assert errors[0] < 0.5 * errors[1]


stable_poles = st.lists(st.floats(-0.5, 0.98), min_size=3, max_size=3)


@settings(max_examples=15)
@given(stable_poles, st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.sampled_from([0.0, 0.5, 2.0, 20.0]))
def test_never_unstable_and_never_worse_than_one_step(poles, d, f, noise):
    abc = -np.poly(poles)[1:]
    law = WheelLaw(*abc, d, 1.0 - np.sum(abc) - d - f, f, 1 / 120)
    runs = step_runs(law, np.random.default_rng(0), noise_rpm=noise, repeats=1, seconds=1.0)
    best = estimate(runs, options=replace(FEW, order="third"))
    assert best.law.is_stable
    assert best.stable_share == 1.0
    assert estimate(runs, options=FEW).law.is_stable
    baseline = estimate(runs, "one-step")
    assert best.rms_rpm <= baseline.rms_rpm * (1.0 + 1e-9) + 1e-6


def test_one_step_is_exact_without_noise_and_biased_with_it(paper, exact_runs, noisy_runs):
    truth = paper.wheel.law.coefficients
    assert np.allclose(estimate(exact_runs, "one-step").coefficients, truth, atol=1e-8)
    assert abs(estimate(noisy_runs, "one-step").coefficients[0] - truth[0]) > 0.2


def test_an_unknown_method_names_the_known_ones(exact_runs):
    with pytest.raises(InputError, match=r'did you mean "output-error".*known: .*one-step'):
        estimate(exact_runs, "output-eror")


def test_every_method_keeps_the_interface(noisy_runs):
    for name in ("output-error", "one-step"):
        found = METHODS[name](noisy_runs, FEW)
        assert found.method == name
        assert len(found.starts) >= 1


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"starts": 0}, "starts = 0"),
        ({"max_iterations": 0}, "max_iterations = 0"),
        ({"max_delay_s": -1.0}, r"max_delay_s = -1\.0"),
        ({"initial": ((1.0, 2.0),)}, "six finite numbers"),
    ],
)
def test_bad_options_are_refused(values, message):
    with pytest.raises(InputError, match=message):
        Options(**values)
