"""Many robots at once."""

import numpy as np
import pytest

from mecanum_env.simulator import SimulationDivergedError
from mecanum_env.tankendo.plant import RobotBatch, compile_model


@pytest.mark.parametrize("row", [0, 1, 2])
def test_the_robot_that_diverged_is_named(paper, row):
    robots = RobotBatch(compile_model(paper, "planar"), 3)
    commands = np.zeros((3, 3))
    commands[row] = np.nan
    with pytest.raises(SimulationDivergedError, match=f"robot {row} diverged"):
        robots.step(commands)
