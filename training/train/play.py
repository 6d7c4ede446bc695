"""Playing many episodes with a policy's network side by side: how training watches itself, and cards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from mecanum_env.model import Model
from mecanum_env.tankendo.opponent import BoolArray
from mecanum_env.tankendo.vector import TankendoVectorEnv
from mecanum_env.units import FloatArray
from training.controllers.policy import Network, remember

DEVELOPMENT_SEEDS: Final = range(100_000, 100_200)
"""Of the episodes that a training run watches itself with; final figures are made with others."""


@dataclass(frozen=True)
class Outcomes:
    """How episodes ended; arrays have one value an episode."""

    success: BoolArray
    hit: BoolArray
    technique: npt.NDArray[np.intp]
    """Index of the technique of the strike; -1 where none came."""
    episode_return: FloatArray
    """Sum of the rewards."""


def play(network: Network, model: Model, seeds: Sequence[int], **arguments: Any) -> Outcomes:
    """Play one episode a seed and return how they ended.

    Args:
        network: the policy.
        model: of the robots.
        seeds: of the episodes; each is the episode of a single environment with that seed.
        arguments: others of `TankendoVectorEnv`, such as `plant` and `difficulty`.
    """
    n = len(seeds)
    env = TankendoVectorEnv(n, model=model, action_mode=network.action_mode, **arguments)
    seen, _ = env.reset(seed=list(seeds))
    memory = remember(None, seen, network.stack)
    over, success, hit = (np.zeros(n, bool) for _ in range(3))
    technique, total = np.full(n, -1, np.intp), np.zeros(n)
    while not over.all():
        seen, reward, terminated, truncated, info = env.step(network.actions(memory))
        total += np.where(over, 0.0, reward)
        ends = (terminated | truncated) & ~over
        if ends.any():
            last = info["final_info"]
            success[ends], hit[ends] = last["is_success"][ends], last["hit"][ends]
            technique[ends] = last["technique"][ends]
            over |= ends
        memory = remember(memory, seen, network.stack)
    env.close()
    return Outcomes(success, hit, technique, total)
