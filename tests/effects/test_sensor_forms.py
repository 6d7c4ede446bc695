"""Laws of the sensors' further forms: late kinds of channels, a window, a drift, an eccentric encoder."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.apply import measured
from mecanum_env.model import paper_model
from mecanum_env.simulator import replay_bench
from mecanum_env.simulator.trajectory import CHANNELS
from mecanum_env.units import RAD_S_PER_RPM

STEP_S = 1 / 480
CLOCK = np.arange(0.0, 2.0, STEP_S)
KINDS = {"wheels": CHANNELS[:4], "body": CHANNELS[4:7], "pose": CHANNELS[7:]}


@pytest.fixture(scope="module")
def motion():
    """Return all channels of a robot log as smooth random paths that begin anywhere."""
    rng = np.random.default_rng(0)
    return {name: np.cumsum(rng.normal(size=CLOCK.size)) for name in CHANNELS}


@pytest.mark.parametrize("kind", KINDS)
def test_only_one_kind_of_channel_is_late(base, motion, kind):
    shown = measured(base.with_effect("sensor_latency", kind, delay_s=0.0731), CLOCK, motion)
    late = measured(base.with_effect("sensor_latency", delay_s=0.0731), CLOCK, motion)
    for name in CHANNELS:
        np.testing.assert_array_equal(shown[name], (late if name in KINDS[kind] else motion)[name])


def test_on_a_bench_late_wheels_are_all_there_is(base):
    time = np.arange(0.0, 1.0, 0.01)
    wheels, everything = (
        replay_bench(base.with_effect("sensor_latency", form, delay_s=0.05), time, np.full(time.shape, 60.0))
        for form in ("wheels", "all")
    )
    np.testing.assert_array_equal(wheels, everything)


@given(window=st.floats(1e-5, 3.0))
def test_the_window_is_the_mean_of_its_last_seconds(window):
    model = paper_model().with_effect("sensor_lowpass", "window", window_s=window)
    ramp = measured(model, CLOCK, {"vx_m_s": 2.0 * CLOCK})["vx_m_s"]
    # Before the start it was as at the start, so that the window fills first.
    moving = np.minimum(CLOCK, window)
    np.testing.assert_allclose(ramp, (2.0 * CLOCK - moving) * moving / window, atol=1e-9)


@given(window=st.floats(0.001, 1.0), seed=st.integers(0, 1000))
def test_the_window_counts_the_way_between_its_ends_and_divides_by_its_length(window, seed):
    speed = np.cumsum(np.random.default_rng(seed).normal(size=CLOCK.size))
    model = paper_model().with_effect("sensor_lowpass", "window", window_s=window)
    shown = measured(model, CLOCK, {"speed_rpm": speed})["speed_rpm"]
    begin = CLOCK[-1] - window
    inside = np.insert(CLOCK[np.searchsorted(CLOCK, begin, side="right") :], 0, begin)
    way = np.trapezoid(np.interp(inside, CLOCK, speed), inside)
    assert shown[-1] == pytest.approx(way / window, abs=1e-8)


def test_the_window_leaves_what_is_constant(base):
    model = base.with_effect("sensor_lowpass", "window", window_s=0.1234)
    settled = measured(model, CLOCK, {"vx_m_s": np.full(CLOCK.shape, 3.3)})["vx_m_s"]
    np.testing.assert_array_equal(settled, 3.3)


@pytest.mark.parametrize("per_s", [-0.3, 0.7])
def test_a_drift_is_the_bias_times_one_plus_its_rate_times_the_time(base, motion, per_s):
    model = base.with_effect("sensor_bias", "drift", vx_m_s=0.1, yaw_rate_rad_s=-0.2, per_s=per_s)
    shown = measured(model, CLOCK, motion)
    for name, bias in (("vx_m_s", 0.1), ("vy_m_s", 0.0), ("yaw_rate_rad_s", -0.2)):
        np.testing.assert_allclose(shown[name] - motion[name], bias * (1 + per_s * CLOCK), atol=1e-12)
    for name in (*KINDS["wheels"], *KINDS["pose"]):
        np.testing.assert_array_equal(shown[name], motion[name])


def test_a_drift_of_no_rate_is_the_constant_bias(base, motion):
    drift, constant = (
        measured(base.with_effect("sensor_bias", form, vx_m_s=0.1, vy_m_s=-0.1), CLOCK, motion)
        for form in ("drift", "constant")
    )
    for name in CHANNELS:
        np.testing.assert_array_equal(drift[name], constant[name])


def test_what_a_drift_added_is_taken_off_again(motion):
    effect, values = CATALOGUE["sensor_bias/drift"], {"vx_m_s": 0.1, "vy_m_s": 0.2, "yaw_rate_rad_s": 0.3}
    shown = effect.change_channels(CLOCK, motion, values | {"per_s": 0.4})
    restored = effect.restore_channels(CLOCK, shown, values | {"per_s": 0.4})
    for name in CHANNELS:
        np.testing.assert_allclose(restored[name], motion[name], atol=1e-12)


@pytest.mark.parametrize("form", ["", "/body", "/pose"])
def test_what_was_turned_is_turned_back(motion, form):
    effect, values = CATALOGUE[f"mount_yaw{form}"], {"angle_deg": 20.0}
    restored = effect.restore_channels(CLOCK, effect.change_channels(CLOCK, motion, values), values)
    for name in CHANNELS:
        np.testing.assert_allclose(restored[name], motion[name], atol=1e-12)


def test_an_eccentric_encoder_swings_with_the_angle_of_its_own_wheel(base):
    model = base.with_effect("encoder_eccentricity", per_turn=3, share=0.08, phase_deg=40)
    true = {f"speed_{wheel}_rpm": np.full(CLOCK.shape, rpm) for wheel, rpm in (("fl", 60.0), ("rr", -30.0))}
    shown = measured(model, CLOCK, true)
    for name, rpm in (("speed_fl_rpm", 60.0), ("speed_rr_rpm", -30.0)):
        swing = np.sin(3 * rpm * RAD_S_PER_RPM * CLOCK + np.deg2rad(40))
        np.testing.assert_allclose(shown[name], rpm * (1 + 0.08 * swing), atol=1e-9)


@given(phase=st.floats(-180, 180), per_turn=st.integers(1, 8), share=st.floats(0.01, 0.3))
def test_whole_turns_take_the_right_time_with_an_eccentric_encoder(phase, per_turn, share):
    model = paper_model().with_effect("encoder_eccentricity", per_turn=per_turn, share=share, phase_deg=phase)
    # Starts, stops and turns back a little, and ends after exactly three turns.
    course = np.sin(np.pi * CLOCK / CLOCK[-1]) * (1 + 2 * np.cos(7 * CLOCK))
    course[0] = course[-1] = 0.0
    speed = course * (3 * 60 / (np.sum(course) * STEP_S))
    shown = measured(model, CLOCK, {"speed_rpm": speed})["speed_rpm"]
    assert np.sum(shown) * STEP_S / 60 == pytest.approx(3.0, abs=2e-3)
    assert np.max(np.abs(shown - speed)) > 0.5 * share * np.max(np.abs(speed))


def test_an_eccentric_encoder_shows_in_no_other_channel(base, motion):
    shown = measured(base.with_effect("encoder_eccentricity", share=0.2), CLOCK, motion)
    for name in (*KINDS["body"], *KINDS["pose"]):
        np.testing.assert_array_equal(shown[name], motion[name])
