"""The vector environment on arrays: the same task on the same motion as on MuJoCo, but for rounding."""

import copy
import pickle

import gymnasium
import numpy as np
import pytest

import mecanum_env
from mecanum_env.errors import InputError
from mecanum_env.model import paper_model
from mecanum_env.tankendo.chance import Noise
from mecanum_env.tankendo.vector import TankendoVectorEnv

gymnasium.register_envs(mecanum_env)

RANGES = {"robot.mass_kg": (18, 24), "effects.speed_gain.gain": (0.9, 1.0)}


def actions(steps, n, size=0.15):
    return np.random.default_rng(0).uniform(-size, size, (steps, n, 3)).astype(np.float32)


def played(n, steps, **arguments):
    """Return observations, rewards and ends of an environment, from one seed."""
    env = TankendoVectorEnv(n, autoreset_mode="SameStep", **arguments)
    first, _ = env.reset(seed=5)
    steps = [env.step(action)[:4] for action in actions(steps, n)]
    return [
        np.stack([first, *(step[0] for step in steps)]),
        *map(np.stack, list(zip(*steps, strict=True))[1:]),
    ]


@pytest.mark.parametrize("task", ["dodge", "track", "duel"])
def test_it_plays_as_on_mujoco(task):
    there, here = (played(4, 130, task=task, engine=engine) for engine in ("mujoco", "arrays"))
    assert there[2].any() or there[3].any() or task == "duel"
    for one, other in zip(there, here, strict=True):
        np.testing.assert_allclose(other.astype(float), one.astype(float), atol=1e-5)


@pytest.mark.parametrize("engine", ["arrays", "mujoco"])
def test_drawn_robots_do_not_depend_on_those_beside_them(engine):
    few, many = (TankendoVectorEnv(n, randomize=RANGES, engine=engine) for n in (2, 5))
    for env in (few, many):
        env.reset(seed=3)
    commands = actions(20, 5, 0.8)
    for command in commands:
        one, other = few.step(command[:2])[0], many.step(command)[0]
        np.testing.assert_allclose(other[:2], one, atol=1e-6)


def test_a_reset_touches_its_own_rows_only():
    env = TankendoVectorEnv(3, engine="arrays", randomize=RANGES)
    env.reset(seed=0)
    for action in actions(5, 3, 0.8):
        env.step(action)
    before = env.arena.robots.motion()
    env.reset(options={"reset_mask": np.array([False, True, False])})
    same = np.all(before == env.arena.robots.motion(), axis=0)
    np.testing.assert_array_equal(same, [True, False, True])


@pytest.mark.parametrize("engine", ["arrays", "mujoco"])
def test_a_reset_leaves_the_episodes_beside_it_as_they_are(engine):
    envs = [
        TankendoVectorEnv(3, engine=engine, randomize=RANGES, autoreset_mode="Disabled") for _ in range(2)
    ]
    for env in envs:
        env.reset(seed=0)
    for step, action in enumerate(actions(16, 3, 0.3)):
        if step in (4, 5, 9):
            envs[1].reset(options={"reset_mask": np.array([False, True, False])})
        one, other = ((*env.step(action)[:4], env.arena.robots.motion().T) for env in envs)
        for left, right in zip(one, other, strict=True):
            np.testing.assert_array_equal(left[[0, 2]], right[[0, 2]])


@pytest.mark.parametrize("engine", ["arrays", "mujoco"])
def test_drawn_robots_of_a_reset_are_those_of_a_fresh_environment(engine):
    used, fresh = (TankendoVectorEnv(3, engine=engine, randomize=RANGES) for _ in range(2))
    for seed in range(3):
        used.reset(seed=seed)
        used.step(actions(1, 3, 0.8)[0])
    for env in (used, fresh):
        env.reset(seed=7)
    for action in actions(10, 3, 0.8):
        np.testing.assert_array_equal(used.step(action)[0], fresh.step(action)[0])
        np.testing.assert_array_equal(used.arena.robots.motion(), fresh.arena.robots.motion())


@pytest.mark.parametrize("device", [None, "cpu"])
@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_bit_for_bit(duplicate, device):
    if device:
        pytest.importorskip("torch", reason="torch is not installed")
    model = (
        paper_model().with_effect("command_latency", delay_s=0.05).with_effect("body_speed_limit", v_rpm=60)
    )
    env = TankendoVectorEnv(2, engine="arrays", model=model, device=device)
    env.reset(seed=0)
    played = actions(8, 2, 0.8)
    for action in played[:4]:
        env.step(action)
    other = duplicate(env)
    for action in played[4:]:
        np.testing.assert_array_equal(env.step(action)[0], other.step(action)[0])


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_draws_the_same_robots_from_then_on(duplicate):
    env = TankendoVectorEnv(2, engine="arrays", randomize=RANGES)
    env.reset(seed=0)
    other = duplicate(env)
    for _ in range(2):
        np.testing.assert_array_equal(env.reset()[0], other.reset()[0])
        for action in actions(4, 2, 0.8):
            env.step(action), other.step(action)
            np.testing.assert_array_equal(env.arena.robots.motion(), other.arena.robots.motion())


def test_torch_plays_the_same():
    pytest.importorskip("torch", reason="torch is not installed")
    numpy, torch = (played(3, 20, engine="arrays", device=device) for device in (None, "cpu"))
    for one, other in zip(numpy, torch, strict=True):
        np.testing.assert_allclose(other.astype(float), one.astype(float), atol=1e-5)


def test_drawing_puts_the_first_robot_into_mujoco():
    env = gymnasium.make_vec(
        "MecanumTankendo-v0",
        num_envs=3,
        vectorization_mode="vector_entry_point",
        engine="arrays",
        render_mode="rgb_array",
    )
    env.reset(seed=0)
    (before,) = env.render()
    for _ in range(8):
        env.step(np.tile(np.float32([1, 0, 0]), (3, 1)))
    (after,) = env.render()
    assert before.shape == after.shape == (480, 640, 3)
    assert np.any(before != after)
    env.close()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"engine": "warp"}, "engine = 'warp', must be mujoco, arrays"),
        ({"engine": "arrays", "plant": "rollers"}, 'engine = "arrays" has no rollers'),
        ({"device": "cpu"}, 'only engine="arrays" has one'),
        ({"engine": "arrays", "render_mode": "human"}, "render_mode = 'human', must be rgb_array"),
    ],
)
def test_what_it_does_not_do_is_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        TankendoVectorEnv(2, **arguments)


def test_noise_is_that_of_its_seed_whenever_it_is_made():
    one, two = Noise(3, 17), Noise(1, 17)
    one.restart(np.arange(3), np.array([4.0, 9.0, 7.0]))
    two.restart(np.arange(1), np.array([9.0]))
    early = [two.at(step) for step in range(40)]
    late = one.at(np.array([0, 35, 3]))
    np.testing.assert_array_equal(late[:, 1:2], early[35])
    np.testing.assert_array_equal(one.first(np.array([1])), early[0])


def test_noise_is_standard_normal():
    noise = Noise(200, 17)
    noise.restart(np.arange(200), np.arange(200.0))
    drawn = np.concatenate([noise.at(np.full(200, step)).ravel() for step in range(40)])
    assert abs(drawn.mean()) < 0.02
    assert drawn.std() == pytest.approx(1.0, abs=0.01)
    assert np.mean(np.abs(drawn) > 2.0) == pytest.approx(0.0455, abs=0.003)
