"""Data that cannot determine a law: a clear error, or wide intervals; never a traceback or a warning."""

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.errors import InputError
from sysid.fit.estimators import Options, WheelRun, estimate
from sysid.fit.statistics import residual_tests, uncertainty
from sysid.studies.synthetic import step_runs

METHODS = ("output-error", "one-step")
EVERYTHING = Options(starts=3, fit_delay=True, fit_saturation=True)


def plain_run(command, speed, **changes):
    ticks = np.arange(len(speed), dtype=float)
    run = WheelRun(
        np.asarray(command, float), ticks, np.asarray(speed, float), np.ones(len(speed)), 0.0, 1 / 120
    )
    return replace(run, **changes)


@pytest.mark.parametrize("method", METHODS)
def test_no_runs(method):
    with pytest.raises(InputError, match="no runs to fit"):
        estimate([], method)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("level", [0.0, 50.0])
def test_a_command_that_never_changes(method, level):
    noise = np.random.default_rng(0).standard_normal(241)
    run = plain_run(np.full(240, level), level + noise, initial_rpm=level)
    with pytest.raises(InputError, match="never leaves the steady start"):
        estimate([run], method)


@pytest.mark.parametrize("method", METHODS)
def test_a_dead_sensor(method):
    with pytest.raises(InputError, match="dead sensor"):
        estimate([plain_run(np.full(240, 80.0), np.zeros(241))], method)


@pytest.mark.parametrize("method", METHODS)
def test_fewer_samples_than_coefficients(method):
    with pytest.raises(InputError, match="6 samples in all, must be at least 7"):
        estimate([plain_run(np.full(240, 80.0), np.arange(6.0))], method)


def test_twenty_samples_give_wide_intervals(paper):
    run = step_runs(paper.wheel.law, np.random.default_rng(1), repeats=1, steps_rpm=[40.0])[0]
    few = replace(
        run, sample_tick=run.sample_tick[:20], speed_rpm=run.speed_rpm[:20], sigma_rpm=run.sigma_rpm[:20]
    )
    found = estimate([few], options=EVERYTHING)
    assert found.law.is_stable
    sure = uncertainty([few], found)
    assert max(q.high - q.low for q in sure.parameters) > 0.5
    assert sure.warnings
    residual_tests([few], found)


def test_seven_samples_do_not_determine_a_third_order_law(paper):
    run = step_runs(paper.wheel.law, np.random.default_rng(1), repeats=1, steps_rpm=[40.0])[0]
    pick = np.array([0, 13, 14, 15, 16, 17, 18])
    few = replace(
        run, sample_tick=run.sample_tick[pick], speed_rpm=run.speed_rpm[pick], sigma_rpm=run.sigma_rpm[pick]
    )
    found = estimate([few], options=replace(EVERYTHING, order="third"))
    assert found.law.is_stable
    sure = uncertainty([few], found)
    assert all(np.isinf(sure[name].standard_error) for name in "ABCDEF")
    simple = estimate([few], options=EVERYTHING)
    assert simple.law.C == simple.law.F == 0.0
    assert "C, F held at 0" in uncertainty([few], simple).warnings[0]
    residual_tests([few], found)


def test_missing_samples_do_not_disturb_the_fit(noisy_runs):
    rng = np.random.default_rng(2)
    gappy = []
    for run in noisy_runs:
        keep = rng.random(len(run.speed_rpm)) > 0.3
        keep[40:70] = False
        gappy.append(
            replace(
                run,
                sample_tick=run.sample_tick[keep],
                speed_rpm=run.speed_rpm[keep],
                sigma_rpm=run.sigma_rpm[keep],
            )
        )
    found = estimate(gappy, options=Options(starts=3))
    assert found.rms_rpm == pytest.approx(np.sqrt(0.25 + 1 / 12), rel=0.05)
    assert residual_tests(gappy, found).passed


def test_saturation_throughout(paper):
    """Every command is above the limit: the law is still found, from the limit's own steps."""
    law = paper.wheel.law
    runs = step_runs(law, np.random.default_rng(3), steps_rpm=[100.0, 120.0], quantum_rpm=0.0)
    rng = np.random.default_rng(4)
    limited = [
        replace(run, speed_rpm=law.simulate(run.command(0.0, 60.0)) + 0.5 * rng.standard_normal(241))
        for run in runs
    ]
    found = estimate(limited, options=EVERYTHING)
    assert found.saturation_rpm == pytest.approx(60.0, abs=0.2)
    assert found.rms_rpm == pytest.approx(0.5, rel=0.1)
    assert uncertainty(limited, found)["saturation_rpm"].standard_error < 0.1


def test_noise_alone_gives_a_stable_law_and_warnings():
    noise = np.random.default_rng(5).standard_normal(241)
    run = plain_run(np.full(240, 40.0), noise)
    for gain in (True, False):
        found = estimate([run], options=replace(EVERYTHING, unit_gain=gain))
        assert found.law.is_stable
        assert uncertainty([run], found).warnings


def test_a_speed_that_runs_away_still_gives_a_stable_law():
    speed = 1.03 ** np.arange(241.0)
    found = estimate([plain_run(np.full(240, 10.0), speed)], options=EVERYTHING)
    assert found.law.is_stable
    assert all(start.stable for start in found.starts)


def test_huge_numbers_and_tiny_sigmas_do_not_warn(paper):
    run = step_runs(paper.wheel.law, np.random.default_rng(6), repeats=1, steps_rpm=[40.0])[0]
    for scale, sigma in ((1e6, 1e-9), (1e-6, 1e3)):
        scaled = replace(
            run,
            command_rpm=run.command_rpm * scale,
            speed_rpm=run.speed_rpm * scale,
            sigma_rpm=np.full(241, sigma),
        )
        found = estimate([scaled], options=Options(starts=3))
        assert found.law.is_stable
        uncertainty([scaled], found)
        residual_tests([scaled], found)
