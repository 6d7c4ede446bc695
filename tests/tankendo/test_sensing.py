"""Environments whose robot senses through frames that get lost, with an estimator behind them."""

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.senses import Senses, VariedSenses
from mecanum_env.tankendo.vector import TankendoVectorEnv

STAND = np.zeros(3, np.float32)
PERFECT = Senses(position_m=0, lost=0, own_velocity_m_s=0, own_yaw_rate_rad_s=0, place_m=0, heading_rad=0)


def errors(begin, senses, steps=25):
    """Return the estimate minus what flawless sensors show, shape (steps, 16, 20), of robots that stand."""
    arena, found = begin(16, senses=senses), []
    for _ in range(steps):
        shown = arena.step(np.zeros((16, 3))).observation
        nothing, extra = np.zeros((17, 16)), np.zeros((0, 16))
        sword, shares = arena.fighter.sword, np.zeros((3, 16))
        found.append(
            shown - arena.instruments.observe(arena.scenes, arena.time_s(), sword, shares, nothing, extra)
        )
    return np.array(found)


def test_what_is_estimated_is_what_is_there(begin):
    places = errors(begin, PERFECT)[5:, :, [0, 1, 4, 5, 6]]
    assert np.sqrt(np.mean(places**2)) < 0.02


def test_worse_senses_estimate_worse(begin):
    sizes = [
        float(np.sqrt(np.mean(errors(begin, senses)[5:, :, :2] ** 2)))
        for senses in (
            PERFECT,
            Senses(),
            Senses(position_m=0.03, lost=0.3, lost_frames=4, camera_delay_s=0.1),
        )
    ]
    assert sizes[0] < sizes[1] < sizes[2]


def test_the_set_share_of_frames_is_lost(begin):
    arena, seen = begin(50, senses=Senses(lost=0.2, lost_frames=3.0)), []
    for _ in range(60):
        arena.step(np.zeros((50, 3)))
        seen.append(arena.sensing._lost.copy())
    assert np.mean(seen) == pytest.approx(0.2, abs=0.03)


def test_one_and_many_sense_the_same(make):
    many = TankendoVectorEnv(3, senses=VariedSenses())
    first, _ = many.reset(seed=7)
    alone = make(senses=VariedSenses())
    np.testing.assert_array_equal(alone.reset(seed=8)[0], first[1])
    for _ in range(10):
        together = many.step(np.tile(STAND, (3, 1)))[0]
        np.testing.assert_array_equal(alone.step(STAND)[0], together[1])


def test_a_second_look_brings_nothing_new(begin):
    arena = begin(2, senses=Senses())
    shown = arena.step(np.zeros((2, 3))).observation
    np.testing.assert_array_equal(arena.observe(), shown)


def test_the_task_appends_its_numbers(make):
    env = make(task="duel", senses=Senses())
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert observation.shape == (23,)


def test_what_are_no_senses_is_refused(make):
    with pytest.raises(InputError, match=r"must be a mecanum_env.senses.Senses"):
        make(senses=0.1)
