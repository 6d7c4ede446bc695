"""The time to the cut that a policy may see: what the sword's motion says, and nothing on guard."""

import numpy as np
import pytest

from mecanum_env.tankendo.constants import TECHNIQUES
from mecanum_env.tankendo.sword import Sword
from mecanum_env.tankendo.vector import TankendoVectorEnv
from training.controllers.features import EXTRA_FEATURES, FAR_S, features, time_to_cut

RISE_S = 0.4
PLACE = [1.7, 0.3, 2.6]
"""x, y and heading of the opponent, as the robot sees it."""


def seen_at(technique, time_s):
    """Return what a robot at rest sees of an opponent at rest whose sword rises from time 0."""
    sword = Sword(1)
    sword.raise_s[:], sword.cut_s[:], sword.land_s[:], sword.free_s[:] = 0.0, RISE_S, RISE_S + 0.1, 2.0
    sword.raised_m[:], sword.raised_height_m[:] = technique.raised_tip_m, technique.raised_height_m
    scene = [*[0.0] * 6, *PLACE, 0.0, 0.0]
    tip, velocity = sword.tip_and_velocity(time_s, scene)
    numbers = [*PLACE[:2], 0.0, 0.0, *tip, *velocity, *[0.0] * 10]
    return np.array(numbers)


@pytest.mark.parametrize("technique", TECHNIQUES, ids=lambda one: one.name)
@pytest.mark.parametrize("time_s", [0.1, 0.2, 0.3, 0.38])
def test_it_is_the_time_that_the_rise_still_takes(technique, time_s):
    # The velocity is a mean over the last 10 ms.
    assert time_to_cut(seen_at(technique, time_s)) == pytest.approx(RISE_S - time_s, abs=0.02)


@pytest.mark.parametrize("technique", TECHNIQUES, ids=lambda one: one.name)
def test_on_guard_it_is_far_and_of_a_drawn_sword_none_is_left(technique):
    assert time_to_cut(seen_at(technique, -0.1)) == FAR_S
    assert time_to_cut(seen_at(technique, RISE_S - 1e-4)) == pytest.approx(0.0, abs=0.01)


def test_noise_on_guard_is_no_strike():
    """An opponent without patience to strike is looked at for six seconds."""
    env = TankendoVectorEnv(
        64, autoreset_mode="Disabled", opponent={"patience_s": (90.0, 90.0)}, engine="arrays"
    )
    observation, _ = env.reset(seed=list(range(64)))
    seen = []
    for _ in range(60):
        seen.append(time_to_cut(observation))
        observation = env.arena.step(np.zeros((64, 3))).observation
    assert np.mean(np.array(seen) < FAR_S) < 0.02


def test_it_is_the_last_feature():
    seen = np.stack([seen_at(technique, 0.2) for technique in TECHNIQUES])
    whole = features(seen, has_time_to_cut=True)
    assert whole.shape == (4, 20 + EXTRA_FEATURES + 1)
    np.testing.assert_array_equal(whole[:, :-1], features(seen))
    np.testing.assert_array_equal(whole[:, -1], time_to_cut(seen))


def test_that_of_many_is_that_of_each():
    seen = np.random.default_rng(4).normal(size=(200, 20))
    together = time_to_cut(seen)
    assert 0.0 < np.mean(together < FAR_S) < 1.0
    np.testing.assert_array_equal(together, [time_to_cut(one) for one in seen])
