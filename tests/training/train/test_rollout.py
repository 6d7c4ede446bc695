"""Rollouts on the device: the minibatches of Stable-Baselines3's own buffer."""

import gymnasium
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
import torch
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.utils import set_random_seed

from training.train.rollout import RolloutOnDevice

STEPS, ROWS = 5, 3


def filled(kind):
    """Return a buffer with random steps."""
    box = gymnasium.spaces.Box(-1.0, 1.0, (4,), np.float32)
    buffer = kind(STEPS, box, gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32), "cpu", n_envs=ROWS)
    rng = np.random.default_rng(0)
    for _ in range(STEPS):
        numbers = [rng.normal(size=shape) for shape in ((ROWS, 4), (ROWS, 2), ROWS)]
        drawn = [torch.as_tensor(rng.normal(size=ROWS), dtype=torch.float32) for _ in range(2)]
        buffer.add(*numbers, rng.random(ROWS) < 0.3, *drawn)
    buffer.compute_returns_and_advantage(torch.zeros(ROWS), np.zeros(ROWS, bool))
    return buffer


@pytest.mark.parametrize("size", [4, 15, None])
def test_two_passes_give_the_minibatches_of_the_library(size):
    found = []
    for kind in (RolloutBuffer, RolloutOnDevice):
        buffer = filled(kind)
        set_random_seed(7)
        found.append([batch for _ in range(2) for batch in buffer.get(size)])
    assert len(found[0]) == len(found[1])
    for theirs, ours in zip(*found, strict=True):
        assert all(torch.equal(a, b) for a, b in zip(theirs, ours, strict=True))


def test_a_new_rollout_is_not_the_old_one():
    buffer = filled(RolloutOnDevice)
    before = next(buffer.get(None)).observations
    buffer.reset()
    buffer.observations[:] = 3.0
    buffer.full = True
    after = next(buffer.get(None)).observations
    assert not torch.equal(before, after)
    assert (after == 3.0).all()
