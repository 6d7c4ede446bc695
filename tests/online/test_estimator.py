import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mecanum_env.errors import InputError
from mecanum_env.law import WheelLaw
from sysid.fit.estimators import WheelRun, estimate
from sysid.online import OnlineEstimator, OnlineOptions, first_order_law, mean_lag_s, track
from sysid.studies.synthetic import free_run_error_rpm, random_samples, random_stable_law

PERIOD = 1.0 / 120.0
FLOOR_RPM = np.hypot(0.5, 1.0 / np.sqrt(12.0))  # noise and rounding of the synthetic samples

anything = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.integers(-135, 135).map(float),
    st.sampled_from([0.0, 135.0, -135.0, 1e6, np.nan]),
)


def published(estimator, command_rpm, speed_rpm):
    return [estimator.update(r, y) for r, y in zip(command_rpm, speed_rpm, strict=True)]


@given(st.lists(st.tuples(anything, anything), min_size=1, max_size=80))
def test_every_law_is_finite_stable_and_of_unit_gain_for_any_input(samples):
    estimator = OnlineEstimator(OnlineOptions(), first_order_law(PERIOD))
    for command, speed in samples:
        found = estimator.update(command, speed)
        assert found.law.is_stable
        # A triple pole is only known to the cube root of the rounding error.
        assert abs(found.law.poles[0]) <= 0.99 + 1e-4
        assert found.law.normalised() == found.law
        assert found.law.dc_gain == pytest.approx(1.0, abs=1e-8)
        assert np.isfinite(found.predicted_rpm)
        assert np.all(np.isfinite(found.standard_errors))


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.5, 5.0, 50.0]))
def test_stable_at_every_step_while_learning_random_laws(seed, noise):
    rng = np.random.default_rng(seed)
    laws = [(random_stable_law(rng, PERIOD), 120) for _ in range(3)]
    data = random_samples(laws, rng, noise_rpm=noise)
    start = random_stable_law(rng, PERIOD)
    for found in published(OnlineEstimator(OnlineOptions(), start), data.command_rpm, data.speed_rpm):
        assert found.law.is_stable
        assert found.law.normalised() == found.law


@pytest.mark.parametrize("hold", [1, 12, 300])
def test_absurd_signals_on_the_slowest_law_do_not_break_the_arithmetic(hold):
    abc = -np.poly([0.9899] * 3)[1:]
    slow = WheelLaw.from_coefficients([*abc, 1.0, 0.0, 1.0], PERIOD).normalised()
    estimator = OnlineEstimator(OnlineOptions(), slow)
    for k in range(2500):
        found = estimator.update(1e6 * (-1.0) ** (k // hold), 0.0 if k > 2000 else np.nan)
        assert found.law.is_stable
        assert np.all(np.isfinite(found.standard_errors))


@pytest.mark.parametrize("seed", range(3))
def test_after_ten_seconds_it_predicts_new_data_to_the_noise(law, start, seed):
    rng = np.random.default_rng(seed)
    data, held_out = random_samples([(law, 1200)], rng), random_samples([(law, 1200)], rng)
    found = published(OnlineEstimator(OnlineOptions(), start), data.command_rpm, data.speed_rpm)[-1]
    assert free_run_error_rpm(found.law, held_out) <= 1.05 * FLOOR_RPM
    assert found.noise_rpm == pytest.approx(FLOOR_RPM, rel=0.15)


def test_it_converges_to_the_law_of_the_batch_method(law, start):
    data = random_samples([(law, 1200)], np.random.default_rng(3))
    found = published(OnlineEstimator(OnlineOptions(), start), data.command_rpm, data.speed_rpm)[-1]
    ticks = np.arange(1200.0)
    run = WheelRun(data.command_rpm, ticks, data.speed_rpm, np.full(1200, FLOOR_RPM), 0.0, PERIOD)
    batch = estimate([run]).law
    assert free_run_error_rpm(found.law, data) <= 1.02 * free_run_error_rpm(batch, data)
    assert mean_lag_s(found.law) == pytest.approx(mean_lag_s(batch), abs=2e-4)
    assert np.all(np.abs(found.law.coefficients - batch.coefficients) <= 4.0 * found.standard_errors)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "after",
    [
        WheelLaw(0.92, 0.0, 0.0, 0.08, 0.0, 0.0, PERIOD),
        WheelLaw(0.6, 0.1, 0.0, 0.15, 0.1, 0.05, PERIOD),
        WheelLaw(1.5, -0.7, 0.0, 0.1, 0.05, 0.05, PERIOD),
        "random",
    ],
    ids=["slower", "faster", "ringing", "random"],
)
def test_a_changed_law_is_followed_within_two_seconds_of_data(law, after, seed):
    rng = np.random.default_rng(100 + seed)
    after = random_stable_law(rng, PERIOD) if after == "random" else after.normalised()
    data = random_samples([(law, 600), (after, 240)], rng)
    held_out = random_samples([(after, 1200)], rng)
    found = published(OnlineEstimator(OnlineOptions(), law), data.command_rpm, data.speed_rpm)
    assert free_run_error_rpm(found[599].law, held_out) > 5.0 * FLOOR_RPM  # the change is significant
    assert free_run_error_rpm(found[-1].law, held_out) <= 1.2 * FLOOR_RPM


def test_three_minutes_of_constant_command_forget_nothing(law, start):
    rng = np.random.default_rng(5)
    lively = random_samples([(law, 1200)], rng).command_rpm
    command = np.concatenate([lively, np.full(21_600, 60.0)])
    settled = len(lively) + 120
    true = law.simulate(command[:settled])[:-1]
    speed = np.rint(np.concatenate([true, np.full(len(command) - settled, 60.0)]))
    speed += rng.choice([-1.0, 0.0, 1.0], len(speed), p=[0.17, 0.66, 0.17])
    estimator = OnlineEstimator(OnlineOptions(), start)
    before = published(estimator, command[:settled], speed[:settled])[-1]
    wandered = 0.0
    for value in speed[settled:]:
        after = estimator.update(60.0, value)
        wandered = max(wandered, float(np.max(np.abs(after.law.coefficients - before.law.coefficients))))
    assert wandered <= 0.01
    spread = np.trace(np.linalg.inv(after.information)) / np.trace(np.linalg.inv(before.information))
    assert 0.9 <= spread <= 1.1
    assert free_run_error_rpm(after.law, random_samples([(law, 1200)], rng)) <= 1.05 * FLOOR_RPM


def test_information_never_falls_below_the_priors_however_poor_the_excitation(law, start):
    options = OnlineOptions()
    command = np.where(np.arange(6000) // 120 % 2, 40.0, -40.0)  # one amplitude, one period, a minute long
    speed = np.rint(law.simulate(command)[:-1])
    floor = (options.noise_rpm / options.prior_deviation) ** 2
    for found in published(OnlineEstimator(options, start), command, speed):
        assert np.linalg.eigvalsh(found.information)[0] >= 0.999 * floor


def test_half_of_the_samples_missing_has_little_effect(law, start):
    rng = np.random.default_rng(6)
    data, held_out = random_samples([(law, 2400)], rng), random_samples([(law, 1200)], rng)
    speed = np.where(rng.random(2400) < 0.5, np.nan, data.speed_rpm)
    speed[:30] = np.nan
    found = published(OnlineEstimator(OnlineOptions(), start), data.command_rpm, speed)
    assert free_run_error_rpm(found[-1].law, held_out) <= 1.1 * FLOOR_RPM
    assert np.isnan(found[0].innovation_rpm)


def test_a_missing_measurement_changes_nothing_and_a_missing_command_is_the_last_one(law, start):
    data = random_samples([(law, 240)], np.random.default_rng(7))
    one, other = (OnlineEstimator(OnlineOptions(), start) for _ in range(2))
    for estimator in (one, other):
        published(estimator, data.command_rpm, data.speed_rpm)
    before = one.law
    assert one.update(100.0, np.nan).law == before
    other.update(100.0, np.nan)
    assert one.update(np.nan, 50.0).law == other.update(100.0, 50.0).law
    assert one.state() == other.state()


@pytest.mark.parametrize("share", [0.01, 0.05])
def test_outliers_have_little_effect(law, start, share):
    rng = np.random.default_rng(8)
    data, held_out = random_samples([(law, 2400)], rng), random_samples([(law, 1200)], rng)
    wild = rng.random(2400) < share
    speed = data.speed_rpm + wild * rng.choice([-100.0, 100.0], 2400)
    found = published(OnlineEstimator(OnlineOptions(), start), data.command_rpm, speed)[-1]
    assert free_run_error_rpm(found.law, held_out) <= 1.1 * FLOOR_RPM


def test_commands_beyond_a_known_ceiling_count_as_the_ceiling(law, start):
    rng = np.random.default_rng(9)
    data, held_out = random_samples([(law, 1200)], rng), random_samples([(law, 1200)], rng)
    speed = np.rint(law.simulate(np.clip(data.command_rpm, -60.0, 60.0))[:-1])
    options = OnlineOptions(saturation_rpm=60.0)
    found = published(OnlineEstimator(options, start), data.command_rpm, speed)[-1]
    assert free_run_error_rpm(found.law, held_out) <= 1.1 * FLOOR_RPM
    blind = published(OnlineEstimator(OnlineOptions(), start), data.command_rpm, speed)[-1]
    assert free_run_error_rpm(blind.law, held_out) > 2.0 * FLOOR_RPM


@pytest.mark.parametrize("speed", [0.0, 77.0], ids=["dead", "stuck"])
def test_a_sensor_that_shows_one_value_gives_a_stable_law_and_a_large_noise(law, start, speed):
    data = random_samples([(law, 1200)], np.random.default_rng(10))
    found = published(OnlineEstimator(OnlineOptions(), start), data.command_rpm, np.full(1200, speed))
    assert all(item.law.is_stable for item in found)
    assert found[-1].noise_rpm > 5.0 * FLOOR_RPM


def test_without_any_measurement_the_initial_law_stays(start):
    found = published(OnlineEstimator(OnlineOptions(), start), np.full(50, 80.0), np.full(50, np.nan))[-1]
    np.testing.assert_allclose(found.law.coefficients, start.coefficients, atol=1e-15)
    assert found.predicted_rpm == pytest.approx(80.0, rel=1e-3)


def test_a_saved_state_continues_bit_for_bit(law, start):
    data = random_samples([(law, 600)], np.random.default_rng(11))
    whole = published(OnlineEstimator(OnlineOptions(), start), data.command_rpm, data.speed_rpm)
    first = OnlineEstimator(OnlineOptions(), start)
    published(first, data.command_rpm[:300], data.speed_rpm[:300])
    second = OnlineEstimator.from_state(json.loads(json.dumps(first.state(), allow_nan=False)))
    rest = published(second, data.command_rpm[300:], data.speed_rpm[300:])
    assert [item.law for item in rest] == [item.law for item in whole[300:]]
    assert [item.noise_rpm for item in rest] == [item.noise_rpm for item in whole[300:]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "other"}, "format"),
        ({"theta": [1.0]}, "theta"),
        ({"theta": [np.nan] * 5}, "theta"),
        ({"options": {"memory": 3.0}}, "memory"),
        ({"noise": None}, "online state"),
        ({"information": None}, "online state"),
    ],
)
def test_a_broken_state_is_refused(start, change, message):
    state = OnlineEstimator(OnlineOptions(), start).state() | change
    with pytest.raises(InputError, match=message):
        OnlineEstimator.from_state(state)


def test_restart_keeps_the_law_and_resets_the_speeds(law, start):
    data = random_samples([(law, 600)], np.random.default_rng(12))
    estimator = OnlineEstimator(OnlineOptions(), start)
    published(estimator, data.command_rpm, data.speed_rpm)
    before = estimator.law
    estimator.restart()
    found = estimator.update(90.0, 90.0)
    assert found.law == before
    assert found.predicted_rpm == 90.0


def test_an_unstable_start_is_made_stable():
    wild = WheelLaw(3.0, 2.0, 1.0, 50.0, -40.0, 10.0, PERIOD)
    assert OnlineEstimator(OnlineOptions(), wild).law.is_stable


def test_standard_errors_cover_the_truth(law, start):
    scaled = []
    for seed in range(20):
        data = random_samples([(law, 1200)], np.random.default_rng(200 + seed))
        found = published(OnlineEstimator(OnlineOptions(), start), data.command_rpm, data.speed_rpm)[-1]
        scaled.append((found.law.coefficients - law.coefficients) / found.standard_errors)
    spread = np.sqrt(np.mean(np.square(scaled), axis=0))
    assert np.all((spread > 0.3) & (spread < 1.3)), spread  # below 1, since they allow for drift


def test_the_gradient_is_the_derivative_of_the_prediction(law):
    """The recursion for psi is compared with differences of the free run at constant parameters."""
    options = OnlineOptions()
    rng = np.random.default_rng(13)
    command = random_samples([(law, 60)], rng).command_rpm
    estimator = OnlineEstimator(options, law)
    published(estimator, command, np.concatenate([[0.0], np.full(59, np.nan)]))
    step = 1e-6
    for i, to_six in enumerate(np.array([[1, 0, 0, 0, -1, 0], [0, 1, 0, 0, -1, 0], [0, 0, 1, 0, -1, 0],
                                         [0, 0, 0, 1, -1, 0], [0, 0, 0, 0, -1, 1]])):  # fmt: skip
        ends = [
            WheelLaw.from_coefficients(law.coefficients + sign * step * to_six, PERIOD).simulate(command)[-1]
            for sign in (1.0, -1.0)
        ]
        psi = estimator.state()["gradients"][0][i]
        assert psi == pytest.approx((ends[0] - ends[1]) / (2.0 * step), rel=1e-6)


def test_a_thousand_samples_per_run_give_the_same_history_as_update(law, start):
    data = random_samples([(law, 200)], np.random.default_rng(14))
    found = published(OnlineEstimator(OnlineOptions(), start), data.command_rpm, data.speed_rpm)
    history = track(OnlineEstimator(OnlineOptions(), start), data.command_rpm, data.speed_rpm)
    np.testing.assert_array_equal(history.coefficients, [item.law.coefficients for item in found])
    np.testing.assert_array_equal(history.innovation_rpm, [item.innovation_rpm for item in found])
    np.testing.assert_array_equal(history.standard_errors, [item.standard_errors for item in found])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"memory_samples": 0.0}, "memory_samples"),
        ({"memory_samples": 3.0}, "shortest_memory_samples"),
        ({"largest_pole": 1.0}, "largest_pole"),
        ({"noise_rpm": float("nan")}, "noise_rpm"),
        ({"change_ratio": 0.5}, "change_ratio"),
        ({"recent_samples": 1.0}, "recent_samples"),
    ],
)
def test_bad_options_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        OnlineOptions(**change)
