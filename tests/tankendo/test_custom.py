"""Environments over a model with a custom effect."""

import numpy as np

from mecanum_env.model import CustomEffect
from mecanum_env.tankendo.env import TankendoEnv
from mecanum_env.tankendo.vector import TankendoVectorEnv


def driven(env, action, steps=15):
    """Return the observations of an environment that gets one action throughout."""
    seen = [env.reset(seed=3)[0]]
    return np.array(seen + [env.step(action)[0] for _ in range(steps)])


def test_single_and_vector_environments_simulate_it_alike(paper):
    model = paper.with_custom(CustomEffect("load", "-0.5 * speed * abs(sin(2 * angle))"))
    action = np.array([0.8, 0.1, 0.2], np.float32)
    plain = driven(TankendoEnv(model=paper), action)
    single = driven(TankendoEnv(model=model), action)
    vector = driven(TankendoVectorEnv(2, model=model), np.stack([action, action]))
    assert np.max(np.abs(single - plain)) > 0.05
    np.testing.assert_array_equal(vector[:, 0], single)
