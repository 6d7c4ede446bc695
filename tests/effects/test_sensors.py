"""Textbook signatures of the sensors, which act on the log and not on the motion."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.effects.apply import measured
from mecanum_env.model import paper_model
from mecanum_env.simulator import BodyCommands, drive, replay_bench

CLOCK = np.arange(0.0, 1.0, 1 / 480)
TIME = np.arange(0.0, 1.5, 0.01)
STEP = np.full(TIME.shape, 60.0)
SENSORS = [
    ("mount_yaw", {"angle_deg": 10.0}),
    ("sensor_latency", {"delay_s": 0.1}),
    ("sensor_latency/wheels", {"delay_s": 0.1}),
    ("sensor_latency/body", {"delay_s": 0.1}),
    ("sensor_latency/pose", {"delay_s": 0.1}),
    ("sensor_lowpass", {"time_constant_s": 0.1}),
    ("sensor_lowpass/window", {"window_s": 0.1}),
    ("encoder_eccentricity", {"share": 0.1}),
    ("sensor_scale", {"wheel": 0.9, "linear": 0.9, "yaw": 0.9}),
    ("sensor_bias", {"vx_m_s": 0.1, "vy_m_s": 0.1, "yaw_rate_rad_s": 0.1}),
    ("sensor_bias/drift", {"vx_m_s": 0.1, "per_s": 0.1}),
]


@pytest.mark.parametrize(("name", "values"), SENSORS)
def test_the_motion_itself_is_not_changed(base, name, values):
    commands = BodyCommands.constant(60, 30, 10)
    shown, true = (drive(m, commands, 0.5, plant="planar") for m in (base.with_effect(name, **values), base))
    np.testing.assert_array_equal(shown.qpos, true.qpos)
    np.testing.assert_array_equal(shown.twist, true.twist)
    logs = (list(path.channels_at(path.time_s).values()) for path in (shown, true))
    assert not np.array_equal(*logs)


def test_latency_moves_the_rise_and_not_the_steady_state(base):
    late, true = (
        replay_bench(m, TIME, STEP) for m in (base.with_effect("sensor_latency", delay_s=0.1), base)
    )
    np.testing.assert_allclose(late[10:], true[:-10], atol=1e-9)
    assert np.all(late[:10] == 0)
    assert late[-1] == pytest.approx(true[-1], abs=1e-3)


def test_on_a_bench_command_and_sensor_latency_look_the_same(base):
    sensor, command = (
        replay_bench(base.with_effect(name, delay_s=0.05), TIME, STEP)
        for name in ("sensor_latency", "command_latency")
    )
    np.testing.assert_allclose(sensor, command, atol=1e-6)


def test_the_lowpass_is_first_order():
    model = paper_model().with_effect("sensor_lowpass", time_constant_s=0.1)
    ramp = measured(model, CLOCK, {"vx_m_s": 2.0 * CLOCK})["vx_m_s"]
    np.testing.assert_allclose(ramp, 2.0 * (CLOCK - 0.1 * (1 - np.exp(-CLOCK / 0.1))), atol=1e-12)
    settled = measured(model, CLOCK, {"vx_m_s": np.full(CLOCK.shape, 3.0)})["vx_m_s"]
    np.testing.assert_array_equal(settled, 3.0)


def test_the_scale_is_one_factor_per_kind_of_channel(base):
    model = base.with_effect("sensor_scale", wheel=0.9, linear=1.1, yaw=0.8)
    path = drive(model, BodyCommands.constant(50, 20, 10), 0.4, plant="planar")
    shown = path.channels_at(path.time_s)
    for column, wheel in enumerate(("fl", "fr", "rl", "rr")):
        np.testing.assert_allclose(shown[f"speed_{wheel}_rpm"], 0.9 * path.wheels_rpm[:, column])
    np.testing.assert_allclose(shown["vx_m_s"], 1.1 * path.twist[:, 0])
    np.testing.assert_allclose(shown["vy_m_s"], 1.1 * path.twist[:, 1])
    np.testing.assert_allclose(shown["yaw_rate_rad_s"], 0.8 * path.twist[:, 2])
    np.testing.assert_array_equal(shown["x_m"], path.pose[:, 0])


def test_a_bias_is_there_at_rest_too(base):
    path = drive(base.with_effect("sensor_bias", vy_m_s=0.05), BodyCommands.constant(), 0.2, plant="planar")
    shown = path.channels_at(path.time_s)
    np.testing.assert_array_equal(shown["vy_m_s"], 0.05)
    np.testing.assert_array_equal(shown["vx_m_s"], 0.0)


def test_a_turned_frame_gives_a_sideways_part_in_proportion_to_speed(base):
    model = base.with_effect("mount_yaw", angle_deg=10.0)
    for v in (40, 80):
        path = drive(model, BodyCommands.constant(v), 1.0, plant="planar")
        shown, forward = path.channels_at(path.time_s), path.twist[-1, 0]
        # What moves along the body's x comes from the right of a frame turned to the left.
        assert shown["vy_m_s"][-1] == pytest.approx(-np.sin(np.deg2rad(10)) * forward)
        assert shown["vx_m_s"][-1] == pytest.approx(np.cos(np.deg2rad(10)) * forward)
        np.testing.assert_array_equal(shown["yaw_rate_rad_s"], path.twist[:, 2])


@pytest.mark.parametrize(
    ("form", "turned"), [("body", ("vx_m_s", "vy_m_s")), ("pose", ("x_m", "y_m"))], ids=["body", "pose"]
)
def test_of_two_sensors_one_is_turned(base, form, turned):
    plain, both, one = (
        drive(model, BodyCommands.constant(60, 30, 20), 1.0, plant="planar")
        for model in (
            base,
            base.with_effect("mount_yaw", angle_deg=20.0),
            base.with_effect("mount_yaw", form, angle_deg=20.0),
        )
    )
    shown, as_both, as_none = (path.channels_at(path.time_s) for path in (one, both, plain))
    for name, channel in shown.items():
        np.testing.assert_array_equal(channel, (as_both if name in turned else as_none)[name])


def test_with_a_turned_frame_the_measured_path_is_still_the_integral_of_the_measured_velocity(base):
    path = drive(
        base.with_effect("mount_yaw", angle_deg=20.0), BodyCommands.constant(60, 30, 20), 1.5, plant="planar"
    )
    shown, step = path.channels_at(path.time_s), path.time_s[1]
    yaw = shown["yaw_rad"]
    x = np.sum((np.cos(yaw) * shown["vx_m_s"] - np.sin(yaw) * shown["vy_m_s"])[1:]) * step
    y = np.sum((np.sin(yaw) * shown["vx_m_s"] + np.cos(yaw) * shown["vy_m_s"])[1:]) * step
    assert (x, y) == pytest.approx((shown["x_m"][-1], shown["y_m"][-1]), abs=3e-3)


@given(
    delay=st.floats(0.001, 0.3),
    constant=st.floats(0.005, 0.3),
    scale=st.floats(0.5, 1.5),
    seed=st.integers(0, 2**32 - 1),
)
def test_sensors_are_linear_and_compose_in_the_order_of_the_chain(delay, constant, scale, seed):
    paper, channel = paper_model(), np.cumsum(np.random.default_rng(seed).normal(size=CLOCK.size))
    singles = [
        paper.with_effect("sensor_latency", delay_s=delay),
        paper.with_effect("sensor_lowpass", time_constant_s=constant),
        paper.with_effect("sensor_scale", linear=scale),
        paper.with_effect("sensor_bias", vx_m_s=0.3),
    ]
    together = paper
    one_by_one = {"vx_m_s": channel}
    for single in singles:
        together = together.with_effect(
            *next((n,) for n in single.effects), **next(iter(single.effects.values()))
        )
        one_by_one = measured(single, CLOCK, one_by_one)
    shown = measured(together, CLOCK, {"vx_m_s": channel})["vx_m_s"]
    np.testing.assert_array_equal(shown, one_by_one["vx_m_s"])
    doubled = measured(together, CLOCK, {"vx_m_s": 2 * channel})["vx_m_s"]
    np.testing.assert_allclose(doubled - 0.3, 2 * (shown - 0.3), atol=1e-9)
