"""A copy of an environment continues like the original, and independently of it."""

import copy
import pickle

import gymnasium
import numpy as np
import pytest

import mecanum_env  # noqa: F401  (registers the environments)
from mecanum_env.tankendo.vector import TankendoVectorEnv

WAYS = {"deepcopy": copy.deepcopy, "pickle": lambda env: pickle.loads(pickle.dumps(env))}
EFFECTS = {
    "none": {},
    "drives": {"command_latency": {"delay_s": 0.07}, "acceleration_limit": {"limit_rpm_s": 200.0}},
    "body": {"body_speed_limit": {"v_rpm": 60.0}, "payload": {"mass_kg": 3.0}},
    "sensors": {"sensor_lowpass": {"time_constant_s": 0.1}},
}


@pytest.fixture(params=EFFECTS)
def model(request, paper):
    changed = paper
    for name, values in EFFECTS[request.param].items():
        changed = changed.with_effect(name, **values)
    return changed


@pytest.mark.parametrize("plant", ["planar", "rollers"])
@pytest.mark.parametrize("way", WAYS)
def test_a_copy_goes_on_bit_for_bit(make, model, plant, way):
    rng = np.random.default_rng(0)
    env = make(model=model, plant=plant, task="duel")
    env.reset(seed=0)
    for action in rng.uniform(-1, 1, (4, 3)):
        env.step(action)
    twin = WAYS[way](env)
    actions = rng.uniform(-1, 1, (8, 3))
    # First all of one, then all of the other: they share nothing.
    seen = [[each.step(action) for action in actions] + [each.reset()] for each in (env, twin)]
    for one, other in zip(*seen, strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        assert one[1:] == other[1:]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    "arguments", [{}, {"randomize": {"effects.payload.mass_kg": (0, 5)}}, {"task": "track", "threads": 2}]
)
def test_copies_of_many_go_on_bit_for_bit(arguments, way):
    # Slow commands: episodes end, and new ones begin, after the copy.
    actions = np.random.default_rng(0).uniform(-0.15, 0.15, (60, 4, 3))
    envs = TankendoVectorEnv(4, **arguments)
    envs.reset(seed=0)
    for action in actions[:10]:
        envs.step(action)
    twins = WAYS[way](envs)
    seen = [[each.step(action)[:4] for action in actions[10:]] for each in (envs, twins)]
    for one, other in zip(*seen, strict=True):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a, b)


def test_what_gymnasium_made_can_be_copied_while_it_is_drawn():
    env = gymnasium.make("MecanumTankendo-v0", render_mode="rgb_array")
    env.reset(seed=0)
    frame = env.render()
    twin = copy.deepcopy(env)
    np.testing.assert_array_equal(twin.render(), frame)
    twin.close()
    np.testing.assert_array_equal(env.render(), frame)
    env.close()
