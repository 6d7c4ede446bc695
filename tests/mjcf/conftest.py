"""Compiled robots, once for all tests; a test that changes one makes its own."""

import mujoco
import pytest

from mecanum_env.mjcf import planar_spec, robot_spec
from mecanum_env.model import Model, paper_model


@pytest.fixture(scope="session")
def packaged() -> Model:
    return paper_model()


@pytest.fixture(scope="session")
def rollers(packaged: Model) -> mujoco.MjModel:
    return robot_spec(packaged).compile()


@pytest.fixture(scope="session")
def planar(packaged: Model) -> mujoco.MjModel:
    return planar_spec(packaged).compile()
