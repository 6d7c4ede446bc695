import math
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.errors import InputError, UnstableLawError
from mecanum_env.law import WheelLaw
from mecanum_env.law.metrics import law_step_metrics
from sysid.fit.estimators import Options, estimate
from sysid.fit.statistics import residual_tests, uncertainty
from sysid.fit.statistics.identifiability import linearise
from sysid.studies.synthetic import step_runs

ONE = Options(starts=1)


@pytest.fixture(scope="module")
def realisations():
    """40 fits of the paper's law with their runs."""
    from mecanum_env.model import paper_model

    rng = np.random.default_rng(0)
    result = []
    for _ in range(40):
        runs = step_runs(paper_model().wheel.law, rng)
        result.append((runs, estimate(runs, options=ONE)))
    return result


def test_standard_errors_are_the_scatter_over_realisations(realisations, paper):
    found = np.array([fitted.coefficients for _, fitted in realisations])
    scatter = found.std(axis=0, ddof=1)
    sure = [uncertainty(runs, fitted) for runs, fitted in realisations]
    for i, name in enumerate("ABCDEF"):
        typical = np.median([u[name].standard_error for u in sure])
        assert scatter[i] == pytest.approx(typical, rel=0.3)
        assert scatter[i] < 1.3 * np.median([u[name].cramer_rao for u in sure])
        truth = getattr(paper.wheel.law, name)
        assert np.mean([u[name].low < truth < u[name].high for u in sure]) > 0.85


def test_a_right_law_passes_the_residual_tests(realisations):
    tests = [residual_tests(*pair) for pair in realisations[:30]]
    assert np.mean([t.passed for t in tests]) > 0.85
    assert 0.2 < np.mean([t.whiteness.p_value for t in tests]) < 0.8
    assert 0.2 < np.mean([t.input_correlation.p_value for t in tests]) < 0.8


def test_intervals_of_the_metrics_cover_the_truth(realisations, paper):
    truth = law_step_metrics(paper.wheel.law)
    sure = [uncertainty(runs, fitted)["rise_time_s"] for runs, fitted in realisations]
    assert np.mean([q.low < truth.rise_time_s < q.high for q in sure]) > 0.85
    assert max(q.relative_error for q in sure) < 0.01


def test_the_covariance_includes_the_eliminated_coefficient(noisy_runs):
    sure = uncertainty(noisy_runs, estimate(noisy_runs, options=ONE))
    assert sure.covariance.shape == (6, 6)
    # The six sum to 1, so their errors sum to 0.
    assert np.allclose(sure.covariance @ np.ones(6), 0.0, atol=1e-12)
    assert sure["E"].standard_error == pytest.approx(math.sqrt(sure.covariance[4, 4]))
    assert sure["dc_gain"].standard_error == 0.0


def test_a_freed_gain_has_an_interval(noisy_runs):
    gain = uncertainty(noisy_runs, estimate(noisy_runs, options=Options(starts=1, unit_gain=False)))[
        "dc_gain"
    ]
    assert 0.0 < gain.standard_error < 1e-3
    assert gain.low < 1.0 < gain.high


def test_intervals_shrink_with_the_root_of_the_data(paper):
    errors = []
    for repeats in (2, 8):
        runs = step_runs(paper.wheel.law, np.random.default_rng(1), repeats=repeats)
        truth = replace(estimate(runs, options=ONE), law=paper.wheel.law)
        errors.append(uncertainty(runs, truth)["A"].cramer_rao)
    assert errors[0] == pytest.approx(2.0 * errors[1], rel=1e-6)


def test_held_samples_widen_the_intervals(noisy_runs):
    fitted = estimate(noisy_runs, options=ONE)
    samples = sum(len(run.speed_rpm) for run in noisy_runs)
    plain = uncertainty(noisy_runs, fitted)
    held = uncertainty(noisy_runs, fitted, effective_samples=samples / 4)
    assert held["B"].cramer_rao == pytest.approx(2.0 * plain["B"].cramer_rao)
    with pytest.raises(InputError, match="effective_samples = 0"):
        uncertainty(noisy_runs, fitted, effective_samples=0)


def test_delay_and_saturation_have_intervals(paper, noisy_runs):
    rng = np.random.default_rng(2)
    runs = []
    for run in noisy_runs:
        speed = paper.wheel.law.simulate(run.command(0.0523, 100.0))
        runs.append(replace(run, speed_rpm=speed + 0.577 * rng.standard_normal(len(speed))))
    fitted = estimate(runs, options=Options(starts=1, fit_delay=True, fit_saturation=True))
    sure = uncertainty(runs, fitted)
    assert abs(sure["saturation_rpm"].value - 100.0) < 4.0 * sure["saturation_rpm"].standard_error < 0.5
    assert abs(sure["delay_s"].value - 0.0523) < 4.0 * sure["delay_s"].standard_error < 0.01


def test_a_wrong_law_is_flagged(paper, noisy_runs):
    fitted = estimate(noisy_runs, options=ONE)
    wrong = replace(fitted, law=replace(paper.wheel.law, A=0.80).normalised())
    tests = residual_tests(noisy_runs, wrong, fitted=False)
    assert not tests.whiteness.passed
    assert not tests.input_correlation.passed


def test_a_rate_limit_is_flagged_although_the_fit_is_the_best(paper, noisy_runs):
    rng = np.random.default_rng(3)
    runs = []
    for run in noisy_runs:
        ramp = np.minimum(run.command_rpm, np.maximum(np.arange(240) - 11, 0) * 4.0)
        speed = paper.wheel.law.simulate(ramp)
        runs.append(replace(run, speed_rpm=speed + 0.577 * rng.standard_normal(len(speed))))
    tests = residual_tests(runs, estimate(runs, options=ONE))
    assert not tests.input_correlation.passed


def test_coloured_noise_fails_whiteness(exact_runs):
    rng = np.random.default_rng(4)
    runs = []
    for run in exact_runs:
        white = rng.standard_normal(len(run.speed_rpm) + 1)
        coloured = 0.5 * (white[1:] + white[:-1])
        runs.append(replace(run, speed_rpm=run.speed_rpm + coloured, sigma_rpm=np.full(len(coloured), 0.7)))
    tests = residual_tests(runs, estimate(runs, options=ONE))
    assert not tests.whiteness.passed
    assert tests.whiteness.correlation[0] == pytest.approx(0.5, abs=0.1)


def test_coefficients_that_trade_off_are_named(paper):
    runs = step_runs(paper.wheel.law, np.random.default_rng(5), noise_rpm=2.0)
    sure = uncertainty(runs, estimate(runs, options=ONE))
    text = "\n".join(sure.warnings)
    assert "interval wider than the value" in text
    assert "least known combination" in text
    assert "well determined nevertheless: rise_time_s = 0.12" in text


@pytest.mark.parametrize("seed", range(4))
def test_a_third_pole_that_noise_decides_leaves_coefficients_unknown(paper, seed):
    """One noisy step: the best third-order law rings to follow the noise, with small linearised errors."""
    runs = step_runs(paper.wheel.law, np.random.default_rng(seed), noise_rpm=2.0, repeats=1, steps_rpm=[40.0])
    sure = uncertainty(runs, estimate(runs, options=Options(starts=3, order="third")))
    assert all(math.isinf(sure[name].standard_error) for name in "ABCDEF")
    assert "a second-order law explains these data as well" in sure.warnings[0]


def sampled_at_10_hz(runs):
    return [
        replace(
            run,
            sample_tick=run.sample_tick[::12],
            speed_rpm=run.speed_rpm[::12],
            sigma_rpm=run.sigma_rpm[::12],
        )
        for run in runs
    ]


def test_a_pair_that_trades_off_is_named(paper):
    runs = sampled_at_10_hz(step_runs(paper.wheel.law, np.random.default_rng(5)))
    text = "\n".join(uncertainty(runs, estimate(runs, options=ONE)).warnings)
    assert "B, C, F held at 0: a law of order 1" in text
    assert "D and E can hardly be told apart: correlation -0.9" in text


def test_the_order_is_that_of_the_data():
    # A first-order law, a second-order law and the paper's, at the same noise.
    for abc, d, order in (
        ((0.9, 0.0, 0.0), 0.04, 1),
        ((1.2, -0.35, 0.0), 0.05, 2),
        ((0.881, -0.151, 0.122), 0.0744, 3),
    ):
        f = -0.0748 if order == 3 else 0.0
        law = WheelLaw(*abc, d, 1.0 - sum(abc) - d - f, f, 1 / 120)
        runs = step_runs(law, np.random.default_rng(7))
        found = estimate(runs, options=ONE)
        assert found.free == {1: ("A", "D"), 2: ("A", "B", "D"), 3: ("A", "B", "C", "D", "F")}[order]
        sure = uncertainty(runs, found)
        assert all(abs(sure[n].value - getattr(law, n)) <= 4.0 * sure[n].standard_error for n in "ABCDEF")


def test_slow_samples_do_not_make_the_law_ring_between_them(paper):
    runs = sampled_at_10_hz(step_runs(paper.wheel.law, np.random.default_rng(8)))
    found = estimate(runs, options=Options(starts=5))
    error = found.law.simulate(np.full(60, 100.0)) - paper.wheel.law.simulate(np.full(60, 100.0))
    assert np.max(np.abs(error[3:])) < 6.0  # the first ticks after a step lie between two samples


def test_well_determined_coefficients_are_not_warned_about(noisy_runs):
    assert uncertainty(noisy_runs, estimate(noisy_runs, options=ONE)).warnings == ()


def test_coefficients_without_any_effect_are_unknown(noisy_runs):
    """With D = E = F = 0 in a freed law the poles have no effect at all."""
    fitted = estimate(noisy_runs, options=Options(starts=1, unit_gain=False))
    silent = replace(fitted, law=WheelLaw(0.5, 0.1, 0.0, 0.0, 0.0, 0.0, 1 / 120))
    assert linearise(noisy_runs, silent).unknown.tolist() == [True] * 3 + [False] * 3
    sure = uncertainty(noisy_runs, silent)
    assert math.isinf(sure.condition_number)
    assert sure["A"].low == -math.inf


def test_an_unstable_law_has_no_statistics(noisy_runs):
    fitted = replace(estimate(noisy_runs, options=ONE), law=WheelLaw(1.2, 0, 0, 0.1, 0, 0, 1 / 120))
    with pytest.raises(UnstableLawError, match=r"poles 1\.2"):
        uncertainty(noisy_runs, fitted)


def test_the_predicted_bias_is_what_antithetic_noise_shows(paper, exact_runs):
    """The mean error of fits to +noise and -noise contains only the second order."""
    law, rng = paper.wheel.law, np.random.default_rng(1)
    errors = []
    for _ in range(25):
        noise = [0.8 * rng.standard_normal(len(run.speed_rpm)) for run in exact_runs]
        pair = []
        for sign in (1.0, -1.0):
            runs = [
                replace(run, speed_rpm=run.speed_rpm + sign * e, sigma_rpm=np.full(len(e), 0.8))
                for run, e in zip(exact_runs, noise, strict=True)
            ]
            fitted = estimate(runs, options=Options(initial=(tuple(law.coefficients),), order="third"))
            pair.append(fitted.coefficients - law.coefficients)
        errors.append(np.mean(pair, axis=0))
    sure = uncertainty(runs, replace(fitted, law=law))
    bias = np.array([sure[name].bias for name in "ABCDEF"])
    assert np.sum(bias) == pytest.approx(0.0, abs=1e-12)
    assert np.all(np.abs(np.mean(errors, axis=0) - bias) < 3.5 * np.std(errors, axis=0) / 5.0)
    assert 0.01 < abs(sure["C"].bias) / sure["C"].standard_error < 0.2


def test_the_predicted_bias_falls_with_the_noise_variance(paper, noisy_runs):
    fitted = replace(estimate(noisy_runs, options=ONE), law=paper.wheel.law)
    plain = uncertainty(noisy_runs, fitted)
    more = uncertainty([*noisy_runs, *noisy_runs], fitted)
    assert plain["B"].bias == pytest.approx(2.0 * more["B"].bias, rel=0.02)
