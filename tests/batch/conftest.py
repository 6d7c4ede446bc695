"""What the tests of the batch share: the same episode on MuJoCo's planar plant and on arrays."""

from collections.abc import Callable

import numpy as np
import pytest

from mecanum_env.batch import PlanarBatch, planar_robot
from mecanum_env.effects import CATALOGUE
from mecanum_env.model import Model
from mecanum_env.tankendo.plant import RobotBatch, compile_model

STEPS = 40
ACTING = [
    (effect.name, parameter.name)
    for effect in CATALOGUE.values()
    if effect.acts_in("planar") and effect.changes_motion
    for parameter in effect.parameters
    if effect.name != "static_map"  # its parameters only make sense together
]
"""Every effect that changes the motion of the planar plant, with each of its parameters."""


def commands(n: int, steps: int = STEPS) -> np.ndarray:
    """Return random commands (steps, n, 3), most of them held for some periods."""
    rng = np.random.default_rng(3)
    drawn = np.round(rng.uniform([-90, -180, -60], [90, 180, 60], (steps, n, 3)))
    return drawn[np.arange(steps) - np.arange(steps) % 3]


def path(robots: RobotBatch | PlanarBatch, own: list | None = None) -> np.ndarray:
    """Drive robots through an episode in which one starts anew; return their motion (steps, 6, n)."""
    for row in range(robots.n):
        robots.restart(row, (0.1 * row, -0.2, 0.4 * row), own[row] if own else None)
    motion = []
    for step, command in enumerate(commands(robots.n)):
        if step == 7:
            robots.restart(1, (0.5, 0.0, 1.0), own[1] if own else None)
        robots.step(command)
        motion.append(robots.motion().copy())
    return np.array(motion)


@pytest.fixture(scope="session")
def apart() -> Callable[..., float]:
    """Return a function of models, the first of which is common: how far the two plants end up apart."""

    def largest(*models: Model, device: str | None = None, timestep_s: float | None = None) -> float:
        compiled = [compile_model(model, "planar", timestep_s) for model in models]
        rows = [planar_robot(model, timestep_s) for model in models]
        n = max(2, len(models))
        own = (compiled, rows) if len(models) > 1 else (None, None)
        there = path(RobotBatch(compiled[0], n), own[0])
        return float(np.max(np.abs(path(PlanarBatch(rows[0], n, device), own[1]) - there)))

    return largest
