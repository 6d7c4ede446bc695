"""The native vector environment equals single environments, and Gymnasium's own, bit for bit."""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import NormalizeObservation, NormalizeReward, RecordEpisodeStatistics

import mecanum_env  # noqa: F401  (registers the environments)
from mecanum_env.errors import InputError
from mecanum_env.tankendo import Rules
from mecanum_env.tankendo.env import TankendoEnv
from mecanum_env.tankendo.vector import TankendoVectorEnv

RANGES = {"wheel.saturation_rpm": (100, 135), "effects.speed_gain.gain": (0.9, 1.0)}


MODES = ["NextStep", "SameStep", "Disabled"]


def together(n, steps, actions, mode="SameStep", **arguments):
    """Step a vector environment and single ones side by side; return how many episodes ended."""
    vector = TankendoVectorEnv(n, autoreset_mode=mode, **arguments)
    singles = [TankendoEnv(**arguments) for _ in range(n)]
    observations, info = vector.reset(seed=11)
    over, ended = np.zeros(n, bool), 0
    for row, single in enumerate(singles):
        observation, own = single.reset(seed=11 + row)
        np.testing.assert_array_equal(observations[row], observation)
        assert vector.info_of(info, row) == own
    for step in range(steps):
        observations, rewards, terminated, truncated, info = vector.step(actions[step])
        before, over = over, np.zeros(n, bool)
        for row, single in enumerate(singles):
            if mode == "NextStep" and before[row]:
                observation, own = single.reset()
                reward, end, cut = 0.0, False, False
            else:
                observation, reward, end, cut, own = single.step(actions[step, row])
            over[row] = end or cut
            if mode == "SameStep" and over[row]:
                np.testing.assert_array_equal(info["final_obs"][row], observation)
                assert vector.info_of(info["final_info"], row) == own
                assert info["_final_info"][row]
                observation, own = single.reset()
            assert (reward, end, cut) == (rewards[row], terminated[row], truncated[row])
            assert vector.info_of(info, row) == own
            np.testing.assert_array_equal(observations[row], observation)
        if mode == "Disabled" and over.any():
            observations, info = vector.reset(options={"reset_mask": over})
            for row in np.flatnonzero(over):
                observation, own = singles[row].reset()
                np.testing.assert_array_equal(observations[row], observation)
                assert vector.info_of(info, row) == own
        ended += over.sum()
    return ended


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("task", ["dodge", "track", "duel"])
def test_each_row_is_a_single_environment(task, mode):
    # Small and slow commands: the opponent strikes, so that all of the task is gone through.
    actions = np.random.default_rng(0).uniform(-0.15, 0.15, (160, 5, 3)).astype(np.float32)
    ended = together(5, 160, actions, mode, task=task)
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


def test_a_reset_shows_the_other_rows_as_they_were_seen_last():
    """Also where the arena itself was stepped, as evaluations do it."""
    env = TankendoVectorEnv(3)
    env.reset(seed=0)
    step = env.arena.step(np.full((3, 3), 0.2))
    after, _ = env.reset(options={"reset_mask": np.array([False, True, False])})
    np.testing.assert_array_equal(after[[0, 2]], step.observation[[0, 2]])
    alone, _ = TankendoEnv().reset(seed=1)
    assert not np.array_equal(after[1], alone)
    after, _ = env.reset(seed=1, options={"reset_mask": np.array([True, False, False])})
    np.testing.assert_array_equal(after[0], alone)


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
        ({"options": {"reset_mask": [False] * 3}}, "reset_mask: all False, must be True for at least one"),
        ({"options": {"reset_masks": [True] * 3}}, 'did you mean "reset_mask"'),
        ({"options": {"technique": "man"}, "seed": 1}, 'did you mean "men"'),
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

    env = VecMonitor(TankendoVecEnv(TankendoVectorEnv(4, autoreset_mode="SameStep")))
    env.seed(3)
    native = TankendoVectorEnv(4, autoreset_mode="SameStep")
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


@pytest.mark.parametrize("mode", MODES)
def test_with_slow_sensors_too(paper, mode):
    """A reset of another row adds no sample to a sensor's filter."""
    actions = np.random.default_rng(0).uniform(-0.15, 0.15, (60, 5, 3)).astype(np.float32)
    model = paper.with_effect("sensor_lowpass", time_constant_s=0.1)
    assert together(5, 60, actions, mode, model=model) >= 3


@pytest.mark.parametrize("mode", MODES)
def test_it_does_what_gymnasiums_own_vector_environment_does(mode):
    """Beside `SyncVectorEnv`: observations, rewards, ends, and for which rows each key of the info holds."""
    actions = np.random.default_rng(0).uniform(-0.15, 0.15, (70, 3, 3)).astype(np.float32)
    kinds = (
        {"vectorization_mode": "vector_entry_point", "autoreset_mode": mode},
        {"vectorization_mode": "sync", "vector_kwargs": {"autoreset_mode": mode}},
    )
    native, sync = (gymnasium.make_vec("MecanumTankendo-v0", num_envs=3, **kind) for kind in kinds)
    native.reset(seed=5)
    sync.reset(seed=5)
    over, ended = np.zeros(3, bool), 0
    for action in actions:
        if mode == "Disabled" and over.any():
            for envs in (native, sync):
                envs.reset(options={"reset_mask": over})
        (*own, info), (*expected, theirs) = native.step(action), sync.step(action)
        for a, b in zip(own, expected, strict=True):
            np.testing.assert_array_equal(a, b)
        over = own[2] | own[3]
        ended += over.sum()
        for name, mask in info.items():
            if name.startswith("_"):
                np.testing.assert_array_equal(mask, theirs.get(name, np.zeros(3, bool)), name)
    assert ended >= 2
    native.close()
    sync.close()


def test_the_mode_is_next_step_as_in_gymnasium_unless_another_is_chosen():
    env = gymnasium.make_vec("MecanumTankendo-v0", num_envs=2)
    assert env.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    for mode in (*AutoresetMode, *MODES):
        env = gymnasium.make_vec("MecanumTankendo-v0", num_envs=2, autoreset_mode=mode)
        assert env.metadata["autoreset_mode"] == AutoresetMode(mode)
    with pytest.raises(InputError, match=r"autoreset_mode = 'NextSteps'.*did you mean .NextStep"):
        TankendoVectorEnv(2, autoreset_mode="NextSteps")


def test_without_autoreset_an_episode_that_is_over_must_be_reset():
    env = TankendoVectorEnv(2, autoreset_mode="Disabled", rules=Rules(dodge_time_s=0.1))
    env.reset(seed=0)
    env.step(np.zeros((2, 3)))
    with pytest.raises(gymnasium.error.ResetNeeded, match="over"):
        env.step(np.zeros((2, 3)))
    env.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(gymnasium.error.ResetNeeded, match="over"):
        env.step(np.zeros((2, 3)))


def test_wrappers_of_gymnasium_take_it():
    counted = RecordEpisodeStatistics(gymnasium.make_vec("MecanumTankendo-v0", num_envs=4))
    env = NormalizeReward(NormalizeObservation(counted))
    env.reset(seed=0)
    lengths = []
    for _ in range(80):
        observation, reward, terminated, truncated, info = env.step(np.zeros((4, 3), np.float32))
        assert np.isfinite(observation).all()
        assert np.isfinite(reward).all()
        if "episode" in info:
            lengths += info["episode"]["l"][terminated | truncated].tolist()
    single, expected = TankendoEnv(), 0
    single.reset(seed=0)
    terminated = False
    while not terminated:
        _, _, terminated, _, _ = single.step(np.zeros(3, np.float32))
        expected += 1
    assert expected in lengths
    assert counted.episode_count == len(lengths) >= 4


@pytest.mark.parametrize("mode", MODES)
def test_statistics_count_the_steps_of_the_task_in_every_mode(mode):
    env = RecordEpisodeStatistics(
        gymnasium.make_vec(
            "MecanumTankendoTrack-v0", num_envs=2, autoreset_mode=mode, rules=Rules(track_time_s=0.5)
        )
    )
    env.reset(seed=0)
    for _ in range(18):
        _, _, terminated, truncated, info = env.step(np.zeros((2, 3), np.float32))
        over = terminated | truncated
        if over.any():
            np.testing.assert_array_equal(info["episode"]["l"], [5, 5])
            if mode == "Disabled":
                env.reset(options={"reset_mask": over})
    assert env.episode_count == 6


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
