"""The environment as Gymnasium sees it."""

import functools
import operator
import subprocess
import sys
from itertools import pairwise

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import mecanum_env
from mecanum_env.errors import InputError
from mecanum_env.registration import ENVIRONMENTS
from mecanum_env.tankendo import ACTION_MODES, DIFFICULTIES, Opponent, Rules, Sensors
from mecanum_env.tankendo.constants import TECHNIQUES
from mecanum_env.tankendo.drawing import opponent_shapes
from mecanum_env.tankendo.env import TankendoEnv
from mecanum_env.tankendo.judge import TERMS
from mecanum_env.tankendo.vector import TankendoVectorEnv

ORDERS = (
    "import gymnasium, mecanum_env",
    "import mecanum_env, gymnasium",
    "import mujoco, gymnasium",  # mujoco loads the package for its plugin, before gymnasium
)


@pytest.mark.parametrize("render_mode", [None, "rgb_array"])
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_the_checker_of_gymnasium_finds_nothing(name, render_mode, monkeypatch):
    """Its render check, too, on a machine without a display."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    env = gymnasium.make(name, render_mode=render_mode)
    check_env(env.unwrapped)
    env.close()


@pytest.mark.parametrize("order", ORDERS)
def test_the_names_are_known_whatever_is_imported_first(order):
    program = f"{order}; print(len([n for n in gymnasium.registry if n.startswith('MecanumTankendo')]))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == str(len(ENVIRONMENTS))


def test_a_module_and_a_name_make_one_too():
    assert mecanum_env.__version__
    env = gymnasium.make("mecanum_env:MecanumTankendo-v0")
    assert isinstance(env.unwrapped, TankendoEnv)


@pytest.mark.parametrize("task", ["dodge", "track", "duel"])
@pytest.mark.parametrize("plant", ["planar", "rollers"])
def test_a_seeded_rollout_is_the_same_to_the_last_bit(make, task, plant):
    one, other = (make(task=task, plant=plant, randomize={"robot.mass_kg": (18, 22)}) for _ in range(2))
    actions = np.random.default_rng(1).uniform(-1, 1, (25, 3)).astype(np.float32)
    first = [env.reset(seed=5) for env in (one, other)]
    np.testing.assert_array_equal(first[0][0], first[1][0])
    assert first[0][1] == first[1][1]
    for action in actions:
        a, b = one.step(action), other.step(action)
        np.testing.assert_array_equal(a[0], b[0])
        assert a[1:] == b[1:]


def test_another_seed_is_another_episode(make):
    env = make()
    first, _ = env.reset(seed=1)
    again, _ = env.reset()
    other, _ = env.reset(seed=2)
    assert not np.array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("task", ["dodge", "track", "duel"])
def test_the_reward_is_the_sum_of_its_terms(make, task):
    env = make(task=task, reward_weights={"effort": 0.3})
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(60):
        _, reward, terminated, truncated, info = env.step(rng.uniform(-0.4, 0.4, 3).astype(np.float32))
        # One after the other: `sum` compensates for rounding from Python 3.12 on.
        assert reward == functools.reduce(operator.add, (info[f"reward_{name}"] for name in TERMS))
        if terminated or truncated:
            env.reset()


@pytest.mark.parametrize("mode", ACTION_MODES)
@pytest.mark.parametrize("difficulty", DIFFICULTIES)
def test_observations_stay_in_their_space(make, mode, difficulty):
    env = make(action_mode=mode, difficulty=difficulty)
    env.reset(seed=3)
    env.action_space.seed(3)
    for _ in range(80):
        observation, _, terminated, truncated, _ = env.step(env.action_space.sample())
        assert env.observation_space.contains(observation)
        if terminated or truncated:
            env.reset()


@pytest.mark.parametrize(("task", "seconds"), [("dodge", 12.0), ("track", 15.0)])
def test_an_episode_is_truncated_at_its_time_limit(make, task, seconds):
    env = make(task=task, opponent=Opponent(patience_s=(99.0, 99.0), wander_m_s=0.0))
    env.reset(seed=0)
    steps, terminated, truncated = 0, False, False
    while not (terminated or truncated):
        _, _, terminated, truncated, _ = env.step(np.zeros(3, np.float32))
        steps += 1
    assert truncated
    assert steps == round(seconds / 0.1)


def test_an_episode_that_ended_by_itself_is_not_truncated(make):
    env = make()
    env.reset(seed=0)
    terminated = truncated = False
    while not (terminated or truncated):
        _, _, terminated, truncated, info = env.step(np.zeros(3, np.float32))
    assert terminated
    assert not truncated
    assert info["hit"]
    assert not info["is_success"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"difficulty": "herd"}, 'did you mean "hard"'),
        ({"plant": "roller"}, 'did you mean "rollers"'),
        ({"action_mode": "xyz"}, "must be cartesian, polar, command"),
        ({"observation_delay": -1}, "seconds from 0 to 1"),
        ({"reward_weights": {"hits": 1}}, 'did you mean "hit"'),
        ({"model": "nowhere.json"}, "cannot be read"),
        ({"randomize": "posterior"}, "holds no uncertainty"),
        ({"randomize": "all"}, 'must be "none", "posterior", ranges by name or models'),
        ({"render_mode": "ansi"}, 'must be "rgb_array", "human"'),
        ({"task": "fight"}, "must be dodge, track, duel"),
    ],
)
def test_an_argument_that_is_not_usable_says_what_would_be(arguments, message):
    with pytest.raises(InputError, match=message):
        TankendoEnv(**arguments)


def test_the_delay_of_the_observation(make):
    """A delayed observation is the earlier scene; without noise, two delays show the same numbers."""
    silent = Sensors(0.0, *(0.0,) * 7)
    prompt, late = make(sensors=silent, observation_delay=0.0), make(sensors=silent, observation_delay=0.1)
    for env in (prompt, late):
        env.reset(seed=4)
    action = np.array([0.3, 0.1, 0.1], np.float32)
    shown = [(prompt.step(action)[0], late.step(action)[0]) for _ in range(8)]
    for (before, _), (_, after) in pairwise(shown):
        np.testing.assert_allclose(np.delete(after, [13, 14, 15]), np.delete(before, [13, 14, 15]), atol=1e-5)


def test_a_step_needs_an_episode(make):
    env = make(rules=Rules(dodge_time_s=0.1))
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
        env.step(np.zeros(3))
    env.reset(seed=0)
    assert env.step(np.zeros(3))[3]
    with pytest.raises(gymnasium.error.ResetNeeded, match="over"):
        env.step(np.zeros(3))


@pytest.mark.parametrize("technique", ["men", 2, np.int64(2)])
def test_an_episode_begins_where_and_with_what_the_options_say(make, technique):
    env, drawn = make(), make()
    options = {"technique": technique, "start": (0.5, -1.0, 0.2)}
    env.reset(seed=3, options=options)
    drawn.reset(seed=3)
    np.testing.assert_allclose(env.arena.scenes.now[:3, 0], options["start"])
    apart = [one.arena.scenes.now[6:8, 0] - one.arena.scenes.now[:2, 0] for one in (env, drawn)]
    np.testing.assert_allclose(apart[0][0], apart[1][0])
    assert apart[0][1] == 0.0
    np.testing.assert_array_equal(env.arena.chance.technique, 2)
    # The rest is drawn as without options, and so is the next episode.
    np.testing.assert_array_equal(env.arena.chance.warning, drawn.arena.chance.warning)
    np.testing.assert_array_equal(env.reset()[0], drawn.reset()[0])
    names = set()
    while "men" not in names:
        env.reset(options={"technique": "men"})
        _, _, terminated, truncated, info = env.step(np.zeros(3))
        while not (terminated or truncated):
            _, _, terminated, truncated, info = env.step(np.zeros(3))
        names.add(TECHNIQUES[info["technique"]].name)
    assert names == {"men"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (5, "options = 5, must be a dictionary"),
        (
            {"tecnique": "men"},
            'options: no "tecnique" .did you mean "technique".., known are technique, start',
        ),
        ({"technique": "man"}, 'did you mean "men".*must be do, nodo, men, kote or an index 0 .. 3'),
        ({"technique": 4}, "technique = 4, must be do, nodo, men, kote or an index 0 .. 3"),
        ({"technique": True}, "technique = True, must be"),
        ({"technique": None}, "technique = None, must be"),
        ({"start": (0, 0)}, r"start = \(0, 0\), must be three finite numbers: x .m., y .m., yaw .rad."),
        ({"start": (0, 0, np.nan)}, "must be three finite numbers"),
        ({"start": "abc"}, "must be three finite numbers"),
        (
            {"start": (3, 0, 0)},
            r"start = \(3, 0, 0\), must be in the field: x -4.5 .. 1.7 m, y -4.5 .. 4.5 m",
        ),
        ({"start": (0, -5, 0)}, "must be in the field"),
        ({"reset_mask": [True]}, 'no "reset_mask"'),
    ],
)
def test_options_that_are_none_are_refused_and_nothing_begins(make, options, message):
    env, undisturbed = make(), make()
    for each in (env, undisturbed):
        each.reset(seed=0)
    with pytest.raises(InputError, match=message):
        env.reset(seed=1, options=options)
    np.testing.assert_array_equal(env.step(np.zeros(3))[0], undisturbed.step(np.zeros(3))[0])
    np.testing.assert_array_equal(env.reset()[0], undisturbed.reset()[0])


def test_there_is_no_technique_to_choose_where_nobody_strikes(make):
    with pytest.raises(InputError, match='technique: the opponent does not strike in the task "track"'):
        make(task="track").reset(options={"technique": "men"})


def test_all_rows_of_many_begin_as_the_options_say():
    options = {"technique": "kote", "start": (-1.0, 0.5, 0.0)}
    many, one = TankendoVectorEnv(3), TankendoEnv()
    observations, _ = many.reset(seed=4, options=options)
    for row in range(3):
        np.testing.assert_array_equal(observations[row], one.reset(seed=4 + row, options=options)[0])
    mask = np.array([False, True, False])
    again, _ = many.reset(options={"reset_mask": mask, "start": (1.0, 0.0, 0.0)})
    np.testing.assert_array_equal(again[~mask], observations[~mask])
    assert many.arena.scenes.now[0].tolist() == [-1.0, 1.0, -1.0]


def test_the_rules_that_are_played_by_can_be_read(make):
    rules, sensors, opponent = Rules(maai_m=1.9), Sensors(position_m=0.0), Opponent(lead=0.5)
    env = make(rules=rules, sensors=sensors, opponent=opponent)
    setting = env.arena.setting
    assert (setting.rules, setting.sensors, setting.opponent) == (rules, sensors, opponent)


def test_the_opponent_and_the_picture_keep_the_maai_of_the_rules(make):
    env = make(rules=Rules(maai_m=2.1), opponent=Opponent(patience_s=(99.0, 99.0), drift_m_s=0.0))
    env.reset(seed=0)
    for _ in range(40):
        info = env.step(np.zeros(3))[-1]
    assert info["distance_m"] == pytest.approx(2.1, abs=0.05)
    shapes = opponent_shapes(env.arena)
    ring = np.array([shape.start[:2] for shape in shapes if shape.size[2] == 0.003])
    np.testing.assert_allclose(np.linalg.norm(ring - env.arena.scenes.now[6:8, 0], axis=1), 2.1)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ([0.1, np.nan, 0.0], r"action\[1\] = nan, must be a finite number"),
        ([np.inf, 0.0, 0.0], r"action\[0\] = inf, must be a finite number"),
        ([0.0] * 4, r"action has shape \(4,\), must be \(3,\)"),
        ([[0.0] * 3], r"action has shape \(1, 3\), must be \(3,\)"),
        (0.0, r"action has shape \(\), must be \(3,\)"),
        (["a", "b", "c"], "action must be numbers"),
    ],
)
def test_an_action_that_is_none_is_refused_and_nothing_lost(make, action, message):
    env, undisturbed = make(), make()
    for each in (env, undisturbed):
        each.reset(seed=0)
    with pytest.raises(InputError, match=message):
        env.step(action)
    sound = np.array([0.3, 0.1, 0.1], np.float32)
    np.testing.assert_array_equal(env.step(sound)[0], undisturbed.step(sound)[0])
