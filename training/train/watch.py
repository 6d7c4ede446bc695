"""How training watches itself: success of the policy as it is, on episodes that are kept apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.model import Model
from training.controllers.policy import Network, Policy
from training.evaluate import Setup, evaluate
from training.train.environments import level_models, model_of
from training.train.settings import Settings

DEVELOPMENT_SEEDS: Final = range(100_000, 100_200)
"""Of the episodes that a run watches itself with. Choices are made on these; final figures are of others."""


@dataclass(frozen=True)
class Watched:
    """Shares of successes."""

    success: float
    """Of all episodes."""
    worst: float
    """On the robot that it is least on; with one robot the same as `success`."""


def watch(network: Network, settings: Settings, seeds: Sequence[int]) -> Watched:
    """Return what a policy reaches on the robots that it is trained on.

    Args:
        network: the policy as it is.
        settings: of the run.
        seeds: of the episodes, shared out among the robots.
    """
    robots: list[Model] = [model_of(settings)]
    if settings.randomize == "levels":
        robots = list(level_models(robots[0]).values())
    parts = [seeds[start :: len(robots)] for start in range(len(robots))]
    played = [_successes(network, settings, robot, part) for robot, part in zip(robots, parts, strict=True)]
    shares = [float(np.mean(successes)) for successes in played if successes]
    return Watched(float(np.mean(np.concatenate(played))), min(shares))


def _successes(network: Network, settings: Settings, robot: Model, seeds: Sequence[int]) -> list[bool]:
    if not seeds:
        return []
    setup = Setup(
        robot,
        settings.plant,
        settings.task,
        settings.difficulty,
        randomize="posterior" if settings.randomize == "posterior" else "none",
    )
    played = evaluate(lambda *_: Policy(network, {}), setup, seeds, rows=len(seeds))
    return [episode.success for episode in played.episodes]
