"""Two robots: PettingZoo's own tests, and symmetry of the rules."""

import numpy as np
import pytest

from mecanum_env import Opponent
from mecanum_env.errors import InputError
from mecanum_env.tankendo import Sensors
from mecanum_env.tankendo.bout import duel_arena

QUIET = Sensors(0.05, *[0.0] * 7)
FORTH, LEFT = np.array([1.0, 0.0, 0.0]), np.array([1.0, -1.0, -1.0])


@pytest.fixture
def duel_class():
    pytest.importorskip("pettingzoo", reason='needs pettingzoo (the extra "duel")')
    from mecanum_env.tankendo.duel import MecanumTankendoDuel

    return MecanumTankendoDuel


def begun(seed=0, poses=None, swapped=False, **arguments):
    arena = duel_arena(**arguments)
    arena.begin([0], [np.random.default_rng(seed)], poses=poses, swapped=swapped)
    return arena


def sparring(arena, rng):
    """Return actions that hold maai, with a wandering to the side, shape (2, 3)."""
    return hold(arena) + [0.0, 0.1, 0.0] * rng.standard_normal((2, 3))


def wandering(steps=80, seed=1):
    """Return slow actions of both players, shape (steps, 2, 3), between phases of rest."""
    rng = np.random.default_rng(seed)
    phases = np.repeat(0.25 * rng.uniform(-1.0, 1.0, (steps // 8, 2, 3)), 8, axis=0)
    phases[::3] = 0.0
    return phases


def hold(arena):
    """Return actions that keep both players at maai and facing, from where they really are."""
    distance, bearing = arena.scenes.separation()
    return np.stack([distance - arena.setting.rules.maai_m, 0.0 * bearing, bearing], axis=1)


def played(arena, steps=600):
    """Let both players hold maai until the end; return the steps."""
    found = []
    while not arena.ended.any() and len(found) < steps:
        found.append(arena.step(hold(arena)))
    return found


def test_pettingzoo_accepts_the_environment(duel_class):
    from pettingzoo.test import parallel_api_test

    parallel_api_test(duel_class(), num_cycles=100)


def test_a_seed_fixes_a_bout(duel_class):
    from pettingzoo.test import parallel_seed_test

    parallel_seed_test(duel_class, num_cycles=100)


def test_an_agent_without_an_action_is_refused(duel_class):
    env = duel_class()
    env.reset(seed=0)
    with pytest.raises(InputError, match="second"):
        env.step({"first": np.zeros(3, np.float32)})


def test_exchanged_players_have_exchanged_outcomes():
    one, other, rng = begun(3), begun(3, swapped=True), np.random.default_rng(0)
    while not one.ended.any():
        actions = sparring(one, rng)
        mine, its = one.step(actions), other.step(actions[::-1])
        np.testing.assert_allclose(mine.observation, its.observation[::-1], atol=1e-5)
        np.testing.assert_allclose(mine.reward, its.reward[::-1], atol=1e-6)
    assert one.results() != other.results()


def test_mirrored_actions_from_a_mirrored_start_have_a_mirrored_outcome():
    quiet = {"sensors": QUIET, "opponent": Opponent(aim_noise_m=0.0)}
    poses = np.array([[-0.9, 0.2, 0.1], [-0.9, -0.2, -0.2]])
    one, other = begun(4, poses, **quiet), begun(4, poses * LEFT, **quiet)
    rng = np.random.default_rng(0)
    while not one.ended.any():
        actions = sparring(one, rng)
        mine, its = one.step(actions), other.step(actions * LEFT)
        np.testing.assert_allclose(mine.reward, its.reward, atol=1e-6)
        np.testing.assert_allclose(mine.observation[:, 0], its.observation[:, 0], atol=1e-5)
        np.testing.assert_allclose(mine.observation[:, 1], -its.observation[:, 1], atol=1e-5)
    assert one.judge.points.max() == 2


def test_robots_at_maai_that_do_not_evade_are_hit():
    assert any(step.info["hit"].any() for step in played(begun(5)))


def test_the_point_of_one_is_the_point_against_the_other():
    last = played(begun(5))[-1].info
    np.testing.assert_array_equal(last["points"], last["points_against"][::-1])


def test_simultaneous_hits_cancel_each_other():
    arena = begun(0, np.array([[-0.85, 0.0, 0.0]] * 2), sensors=QUIET, opponent=Opponent(aim_noise_m=0.0))
    chance = arena.chance
    for name in ("patience", "feints", "feint_s", "technique", "warning", "wait"):
        getattr(chance, name)[:, 1] = getattr(chance, name)[:, 0]
    for _ in range(30):
        assert not arena.step(np.zeros((2, 3))).info["hit"].any()
    assert arena.fighter.exchange.min() > 0


def test_who_drives_into_the_other_loses():
    arena = begun(0, np.array([[-0.5, 0.0, 0.0]] * 2))
    while not arena.ended.any():
        step = arena.step(np.array([FORTH, 0 * FORTH]))
    assert (step.info["is_success"].tolist(), arena.results()) == ([False, True], ["second"])


def test_who_leaves_the_field_loses():
    arena = begun(0, np.array([[-4.4, 0.0, 0.0], [-1.0, 0.0, 0.0]]))
    while not arena.ended.any():
        step = arena.step(np.array([-FORTH, 0 * FORTH]))
    assert step.info["is_success"].tolist() == [False, True]


def test_points_and_faults_are_worth_the_same_to_both():
    for step in played(begun(6)):
        gains = step.info["reward_success"] + step.info["reward_hit"] + step.info["reward_out"]
        assert gains.sum() == pytest.approx(0.0)


def test_bouts_side_by_side_are_the_bouts_alone():
    many = duel_arena(2)
    many.begin([0, 1], [np.random.default_rng(seed) for seed in (7, 8)])
    alone = begun(8)
    for actions in wandering(40):
        both = many.step(np.repeat(actions, 2, axis=0)).observation
        np.testing.assert_array_equal(both[[1, 3]], alone.step(actions).observation)


def test_two_robots_drive_on_rollers_too():
    arena = begun(0, np.array([[-1.5, 0.0, 0.0]] * 2), plant="rollers")
    for _ in range(8):
        arena.step(np.array([FORTH, FORTH]) * 0.5)
    np.testing.assert_allclose(*arena.scenes.now[:2].T, atol=0.02)
