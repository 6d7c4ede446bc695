"""What the sensors show: frames, noise, and the model's sensor effects."""

import numpy as np
import pytest

from mecanum_env.tankendo import Observed, Sensors, read_observation
from mecanum_env.tankendo.observation import NOISY, SIZE, noise_sizes

SILENT = Sensors(0.0, *(0.0,) * 7)


def observed(make, command, steps=12, **arguments) -> tuple[Observed, object]:
    """Return the last observation of a drive, by name, and the arena."""
    env = make(action_mode="command", **{"sensors": SILENT, **arguments})
    env.reset(seed=6)
    for _ in range(steps):
        observation, *_ = env.step(np.asarray(command, np.float32))
    return read_observation(observation), env.arena


def test_each_number_is_what_its_name_says(make):
    seen, arena = observed(make, (0.4, 0.5, 0.2))
    x, y, yaw, vx, vy, rate, opp_x, opp_y, heading, opp_vx, opp_vy = arena.scenes.now[:, 0]
    turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    place = turn @ (opp_x - x, opp_y - y)
    np.testing.assert_allclose((seen.opponent_x, seen.opponent_y), place, atol=1e-6)
    np.testing.assert_allclose((seen.opponent_vx, seen.opponent_vy), turn @ (opp_vx, opp_vy), atol=1e-6)
    np.testing.assert_allclose((seen.vx, seen.vy, seen.yaw_rate), (*(turn @ (vx, vy)), rate), atol=1e-6)
    np.testing.assert_allclose((seen.x, seen.y), (x, y), atol=1e-6)
    np.testing.assert_allclose((seen.heading_cos, seen.heading_sin), (np.cos(yaw), np.sin(yaw)), atol=1e-6)
    tip = place + 0.85 * (turn @ (np.cos(heading), np.sin(heading)))
    np.testing.assert_allclose((seen.tip_x, seen.tip_y, seen.tip_height), (*tip, 0.58), atol=1e-6)
    theta = np.deg2rad(90)
    held = (0.4 * np.cos(theta), 0.4 * np.sin(theta), 0.2)
    np.testing.assert_allclose((seen.forward_share, seen.left_share, seen.turn_share), held, atol=1e-6)


def test_noise_is_as_large_as_documented(begin):
    noisy, silent = begin(400), begin(400, sensors=Sensors(*(0.05, *(0.0,) * 7)))
    spread = (noisy.observe() - silent.observe()).std(axis=0)
    expected = np.insert(noise_sizes(Sensors()), 13, [0.0] * 3)
    assert len(expected) == SIZE == NOISY + 3
    np.testing.assert_allclose(spread, expected, rtol=0.15, atol=1e-9)


def test_noise_differs_from_step_to_step(begin):
    arena = begin(sensors=Sensors())
    first, second = (arena.chance.noise.at(step) for step in (0, 1))
    assert not np.array_equal(first, second)


@pytest.mark.parametrize(
    ("effect", "values", "changed"),
    [
        ("sensor_bias", {"vx_m_s": 0.1}, {"vx": 0.1}),
        ("sensor_scale", {"linear": 1.5}, {"vx": None, "vy": None}),
        ("mount_yaw", {"angle_deg": 20.0}, {"vx": None, "vy": None, "x": None, "y": None}),
        ("mount_yaw/body", {"angle_deg": 20.0}, {"vx": None, "vy": None}),
        ("mount_yaw/pose", {"angle_deg": 20.0}, {"x": None, "y": None}),
        ("sensor_latency", {"delay_s": 0.1}, {"vx": None, "vy": None, "yaw_rate": None}),
        ("sensor_latency/body", {"delay_s": 0.1}, {"vx": None, "vy": None, "yaw_rate": None}),
        ("sensor_latency/pose", {"delay_s": 0.1}, {"x": None, "y": None, "heading_sin": None}),
        ("sensor_lowpass", {"time_constant_s": 0.1}, {"vx": None, "vy": None, "yaw_rate": None}),
        ("sensor_lowpass/window", {"window_s": 0.2}, {"vx": None, "vy": None, "yaw_rate": None}),
    ],
)
def test_a_sensor_effect_changes_what_the_robot_measures_of_itself(make, paper, effect, values, changed):
    command, steps = (0.4, 0.2, 0.2), 3
    plain, _ = observed(make, command, steps)
    seen, _ = observed(make, command, steps, model=paper.with_effect(effect, **values))
    for name, size in changed.items():
        difference = float(getattr(seen, name) - getattr(plain, name))
        assert abs(difference) > 1e-3, name
        if size is not None:
            assert difference == pytest.approx(size, abs=1e-6)
    for name in ("opponent_x", "opponent_vx", "tip_x", "tip_height", "forward_share"):
        assert getattr(seen, name) == getattr(plain, name)


def test_sensor_latency_adds_to_the_delay_of_the_observation(make, paper):
    late = paper.with_effect("sensor_latency", delay_s=0.1)
    seen, _ = observed(make, (0.4, 0, 0), 5, model=late)
    before, _ = observed(make, (0.4, 0, 0), 4)
    assert seen.vx == pytest.approx(before.vx, abs=1e-6)


def test_a_drift_counts_the_time_since_the_episode_began(make, paper):
    model = paper.with_effect("sensor_bias", "drift", vx_m_s=0.1, per_s=0.5)
    for steps in (1, 12, 60):
        seen, arena = observed(make, (0, 0, 0), steps, model=model, task="track")
        assert seen.vx == pytest.approx(0.1 * (1 + 0.5 * arena.time_s()[0]), abs=1e-6)


@pytest.mark.parametrize(
    ("effect", "values"),
    [("sensor_latency/wheels", {"delay_s": 0.1}), ("encoder_eccentricity", {"share": 0.2})],
)
def test_what_wheels_measure_is_not_observed(make, paper, effect, values):
    plain, _ = observed(make, (0.4, 0.2, 0.2))
    seen, _ = observed(make, (0.4, 0.2, 0.2), model=paper.with_effect(effect, **values))
    np.testing.assert_allclose(
        [float(v) for v in vars(seen).values()], [float(v) for v in vars(plain).values()]
    )
