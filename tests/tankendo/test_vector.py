"""The native vector environment equals single ones bit for bit."""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import mecanum_env  # noqa: F401  (registers the environments)
from mecanum_env.errors import InputError
from mecanum_env.tankendo.env import TankendoEnv
from mecanum_env.tankendo.vector import TankendoVectorEnv

RANGES = {"wheel.saturation_rpm": (100, 135), "effects.speed_gain.gain": (0.9, 1.0)}


def together(n, steps, actions, **arguments):
    """Step a vector environment and single ones side by side; return how many episodes ended."""
    vector = TankendoVectorEnv(n, **arguments)
    singles = [TankendoEnv(**arguments) for _ in range(n)]
    observations, info = vector.reset(seed=11)
    ended = 0
    for row, single in enumerate(singles):
        observation, own = single.reset(seed=11 + row)
        np.testing.assert_array_equal(observations[row], observation)
        assert vector.info_of(info, row) == own
    for step in range(steps):
        observations, rewards, terminated, truncated, info = vector.step(actions[step])
        for row, single in enumerate(singles):
            observation, reward, end, cut, own = single.step(actions[step, row])
            assert (reward, end, cut) == (rewards[row], terminated[row], truncated[row])
            assert vector.info_of(info, row) == own
            if end or cut:
                ended += 1
                np.testing.assert_array_equal(info["final_obs"][row], observation)
                assert vector.info_of(info["final_info"], row) == own
                assert info["_final_info"][row]
                observation, _ = single.reset()
            np.testing.assert_array_equal(observations[row], observation)
    return ended


@pytest.mark.parametrize("task", ["dodge", "track", "duel"])
def test_each_row_is_a_single_environment(task):
    # Small and slow commands: the opponent strikes, so that all of the task is gone through.
    actions = np.random.default_rng(0).uniform(-0.15, 0.15, (160, 5, 3)).astype(np.float32)
    ended = together(5, 160, actions, task=task)
    assert ended >= (5 if task != "duel" else 1)


@pytest.mark.parametrize("threads", [1, 2])
def test_on_rollers_and_with_drawn_robots_too(threads):
    actions = np.random.default_rng(0).uniform(-0.3, 0.3, (12, 3, 3)).astype(np.float32)
    vector = TankendoVectorEnv(3, plant="rollers", randomize=RANGES, threads=threads)
    singles = [TankendoEnv(plant="rollers", randomize=RANGES) for _ in range(3)]
    vector.reset(seed=2)
    for row, single in enumerate(singles):
        single.reset(seed=2 + row)
    for action in actions:
        observations, *_ = vector.step(action)
        for row, single in enumerate(singles):
            np.testing.assert_array_equal(observations[row], single.step(action[row])[0])


def test_limits_of_the_body_too(paper):
    model = paper.with_effect("body_speed_limit", v_rpm=60.0).with_effect("command_latency", delay_s=0.07)
    actions = np.random.default_rng(0).uniform(-1, 1, (30, 3, 3)).astype(np.float32)
    together(3, 30, actions, model=model)


def test_sensor_effects_too(paper):
    model = paper.with_effect("sensor_lowpass", time_constant_s=0.1).with_effect("mount_yaw", angle_deg=5.0)
    actions = np.random.default_rng(0).uniform(-1, 1, (30, 3, 3)).astype(np.float32)
    together(3, 30, actions, model=model)


def test_make_vec_finds_it():
    env = gymnasium.make_vec("MecanumTankendoDuel-v0", num_envs=4, difficulty="easy")
    assert isinstance(env.unwrapped, TankendoVectorEnv)
    assert env.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert observation.shape == (4, 23)
    env.close()


def test_a_mask_resets_some():
    env = TankendoVectorEnv(3)
    before, _ = env.reset(seed=0)
    after, _ = env.reset(options={"reset_mask": np.array([False, True, False])})
    changed = np.any(before != after, axis=1)
    np.testing.assert_array_equal(changed, [False, True, False])


def test_the_wrong_number_of_seeds_is_refused():
    with pytest.raises(InputError, match="2 seeds, must be 3"):
        TankendoVectorEnv(3).reset(seed=[1, 2])
    with pytest.raises(InputError, match="num_envs = 0"):
        TankendoVectorEnv(0)


def test_many_are_drawn_one_by_one_only():
    with pytest.raises(InputError, match='vectorization_mode="sync"'):
        gymnasium.make_vec("MecanumTankendo-v0", num_envs=2, render_mode="rgb_array")
    arguments = {"num_envs": 2, "render_mode": "rgb_array"}
    envs = gymnasium.make_vec("MecanumTankendo-v0", vectorization_mode="sync", **arguments)
    envs.reset(seed=0)
    assert [frame.shape for frame in envs.render()] == [(480, 640, 3)] * 2
    envs.close()


def test_seeds_may_be_an_array():
    one, other = TankendoVectorEnv(3), TankendoVectorEnv(3)
    np.testing.assert_array_equal(one.reset(seed=np.array([4, 5, 6]))[0], other.reset(seed=4)[0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"seed": [1.5, 2, 3]}, "must be a whole number, or one for each environment"),
        ({"seed": "abc"}, "must be a whole number, or one for each environment"),
        (
            {"options": {"reset_mask": [True, False]}},
            r"reset_mask: bool of shape \(2,\), must be bool of shape",
        ),
        ({"options": {"reset_mask": [0, 2, 1]}}, r"reset_mask: int64 of shape \(3,\), must be bool of shape"),
    ],
)
def test_a_reset_that_is_none_is_refused_and_nothing_begins(arguments, message):
    env, undisturbed = TankendoVectorEnv(3), TankendoVectorEnv(3)
    for each in (env, undisturbed):
        each.reset(seed=0)
    with pytest.raises(InputError, match=message):
        env.reset(**arguments)
    np.testing.assert_array_equal(env.step(np.zeros((3, 3)))[0], undisturbed.step(np.zeros((3, 3)))[0])


def test_every_episode_must_have_begun_before_a_step():
    env = TankendoVectorEnv(3)
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
        env.step(np.zeros((3, 3)))
    env.reset(options={"reset_mask": np.array([False, True, True])})
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
        env.step(np.zeros((3, 3)))
    env.reset(options={"reset_mask": np.array([True, False, False])})
    env.step(np.zeros((3, 3)))


def test_stable_baselines_steps_it():
    pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.vec_env import VecMonitor

    from training.train.environments import TankendoVecEnv

    env = VecMonitor(TankendoVecEnv(TankendoVectorEnv(4)))
    env.seed(3)
    native = TankendoVectorEnv(4)
    np.testing.assert_array_equal(env.reset(), native.reset(seed=[3, 4, 5, 6])[0])
    ends = []
    for _ in range(60):
        actions = np.zeros((4, 3), np.float32)
        observation, reward, done, infos = env.step(actions)
        expected = native.step(actions)
        np.testing.assert_array_equal(observation, expected[0])
        np.testing.assert_array_equal(reward, expected[1].astype(np.float32))
        for row in np.flatnonzero(done):
            ends.append(infos[row])
            np.testing.assert_array_equal(infos[row]["terminal_observation"], expected[4]["final_obs"][row])
    assert ends
    assert {"episode", "is_success", "technique", "TimeLimit.truncated"} <= ends[0].keys()


def test_with_slow_sensors_too(paper):
    """Episodes that end beside it are no further samples for a filter."""
    actions = np.random.default_rng(0).uniform(-0.15, 0.15, (60, 5, 3)).astype(np.float32)
    assert together(5, 60, actions, model=paper.with_effect("sensor_lowpass", time_constant_s=0.1)) >= 3


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (np.diag([0.0, 0.0, np.nan]), r"action\[2, 2\] = nan, must be a finite number"),
        (np.zeros((2, 3)), r"action has shape \(2, 3\), must be \(3, 3\)"),
        (np.zeros(3), r"action has shape \(3,\), must be \(3, 3\)"),
    ],
)
def test_actions_that_are_none_are_refused(actions, message):
    env = TankendoVectorEnv(3)
    env.reset(seed=0)
    with pytest.raises(InputError, match=message):
        env.step(actions)
