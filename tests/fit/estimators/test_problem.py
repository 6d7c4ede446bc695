from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.law import LawState, WheelLaw
from mecanum_env.wheel_drive.inputs import latched_commands
from sysid.fit.estimators import WheelRun
from sysid.fit.estimators.interface import shifted_command
from sysid.fit.estimators.problem import stack


def run_of(law, command, initial=0.0, **changes):
    """One exact run, sampled at every tick."""
    speed = law.simulate(command, LawState.steady(initial))
    ticks = np.arange(len(command) + 1.0)
    values = {"sample_tick": ticks, "speed_rpm": speed, "sigma_rpm": np.ones(len(ticks)), **changes}
    return WheelRun(np.asarray(command, float), initial_rpm=initial, sample_period_s=1 / 120, **values)


@pytest.fixture
def law(paper):
    return paper.wheel.law


def commands(seed, ticks=90):
    return np.repeat(np.random.default_rng(seed).uniform(-120, 120, ticks // 6), 6)


@pytest.mark.parametrize("initial", [0.0, 30.0])
def test_prediction_is_the_laws_own_simulation(law, initial):
    run = run_of(law, commands(0), initial)
    problem = stack([run])
    predicted = problem.predict(law.coefficients, problem.traces())
    assert np.allclose(predicted, run.speed_rpm, atol=1e-10)


def test_samples_between_ticks_are_interpolated(law):
    run = run_of(law, commands(1))
    times = np.array([0.25, 3.5, 89.75, 90.0])
    between = replace(run, sample_tick=times, speed_rpm=np.zeros(4), sigma_rpm=np.ones(4))
    problem = stack([between, run])
    predicted = problem.predict(law.coefficients, problem.traces())[problem.group][:4]
    assert np.allclose(predicted, np.interp(times, np.arange(91), run.speed_rpm), atol=1e-10)


@pytest.mark.parametrize("gain", [1.0, 0.8])
def test_jacobian_equals_differences(law, gain):
    c = law.coefficients * np.array([1, 1, 1, gain, gain, gain])
    first = run_of(law, commands(2))
    runs = [
        replace(first, sample_tick=first.sample_tick[:-1] + 0.3, speed_rpm=first.speed_rpm[:-1],
                sigma_rpm=first.sigma_rpm[:-1]),
        run_of(law, commands(3, 60), 50.0),
    ]  # fmt: skip
    problem = stack(runs)
    options = {"with_delay": True, "with_saturation": True}
    delay, limit = 0.0231, 70.0
    _, jacobian = problem.predict_with_jacobian(c, problem.traces(delay, limit, **options))
    for i in range(6):
        step = 1e-6 * np.eye(6)[i]
        traces = problem.traces(delay, limit)
        difference = (problem.predict(c + step, traces) - problem.predict(c - step, traces)) / 2e-6
        assert np.allclose(jacobian[:, i], difference, atol=2e-4 * max(1.0, np.max(np.abs(difference))))
    by_delay = (
        problem.predict(c, problem.traces(delay + 1e-6, limit))
        - problem.predict(c, problem.traces(delay - 1e-6, limit))
    ) / 2e-6
    assert np.allclose(jacobian[:, 6], by_delay, rtol=1e-5, atol=1e-5 * np.max(np.abs(by_delay)))
    by_limit = (
        problem.predict(c, problem.traces(delay, limit + 1e-4))
        - problem.predict(c, problem.traces(delay, limit - 1e-4))
    ) / 2e-4
    assert np.allclose(jacobian[:, 7], by_limit, atol=1e-5)


def test_merging_repeats_keeps_the_weighted_sum_of_squares(law, noisy_runs):
    c = law.coefficients * np.array([1.0, 0.9, 1.0, 1.0, 1.1, 1.0])
    sums = []
    for merge in (True, False):
        problem = stack(noisy_runs, merge=merge)
        residual = (problem.predict(c, problem.traces()) - problem.speed_rpm) * problem.weight
        sums.append(residual @ residual + 2 * problem.within_cost)
    assert sums[0] == pytest.approx(sums[1], rel=1e-12)


def test_repeats_share_one_trace(noisy_runs):
    problem = stack(noisy_runs)
    assert len(problem.sources) == 4
    assert len(problem.group) == sum(len(run.speed_rpm) for run in noisy_runs)


def test_an_unstable_law_has_an_infinite_rms_and_no_warning(noisy_runs):
    problem = stack(noisy_runs)
    predicted = problem.predict([40.0, 0, 0, 0.1, 0, 0], problem.traces())
    assert problem.rms(predicted) == np.inf


def test_shifting_by_whole_ticks_moves_the_command():
    assert shifted_command(np.array([1.0, 2.0, 3.0]), 2.0, 9.0).tolist() == [9.0, 9.0, 1.0]


def test_the_fractional_shift_equals_the_delay_of_the_drive(paper):
    command = np.repeat([0.0, 50.0, 120.0, 20.0], 12)
    times = np.arange(4) * 0.1
    plain = paper.wheel.drive_parameters()
    for delay in (0.0, 0.004, 1 / 120, 0.0371):
        drive = replace(plain, delay_s=delay)
        expected = latched_commands(drive, times, [0.0, 50.0, 120.0, 20.0], 48)
        assert np.allclose(shifted_command(command, delay * 120.0, 0.0), expected, atol=1e-6)


def test_a_source_rebuilds_the_command(law):
    run = replace(run_of(law, commands(4)), source=lambda delay, limit: np.full(90, min(delay, limit)))
    assert np.all(run.command(0.25, 3.0) == 0.25)
    with pytest.raises(InputError, match="command source gave shape"):
        replace(run, source=lambda *_: np.zeros(3)).command(0.25)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"speed_rpm": np.array([0.0, np.nan, 1.0])}, r"speed_rpm\[1\] = nan"),
        ({"sigma_rpm": np.zeros(3)}, "sigma_rpm = 0.0, must be above 0"),
        ({"sample_tick": np.array([0.0, 1.0, 3.5])}, "must lie within the 3 ticks"),
        ({"speed_rpm": np.zeros(2)}, "must be equally many"),
        ({"command_rpm": np.zeros((0,))}, "must be one row"),
        ({"sample_period_s": 0.0}, "sample_period_s = 0.0"),
        ({"initial_rpm": np.inf}, "initial_rpm = inf"),
    ],
)
def test_bad_runs_are_refused(changes, message):
    good = WheelRun(np.ones(3), np.arange(3.0), np.zeros(3), np.ones(3), 0.0, 0.01, "run 7")
    with pytest.raises(InputError, match=f"run 7: .*{message}"):
        replace(good, **changes)


def test_runs_on_different_clocks_are_refused(law, exact_runs):
    other = WheelLaw.from_coefficients(law.coefficients, 0.01)
    with pytest.raises(InputError, match="different clocks"):
        stack([*exact_runs, replace(exact_runs[0], sample_period_s=other.sample_period_s)])
