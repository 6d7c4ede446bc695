"""What tests that draw share: a short drive, and a skip where there is no software renderer."""

import os

import pytest

from mecanum_env.model import paper_model
from mecanum_env.rendering.backend import library_loads


def require(there: object, missing: str) -> None:
    """Skip what this machine cannot do; fail where CI runs, which installs it."""
    if not there:
        (pytest.fail if os.environ.get("CI") else pytest.skip)(missing)


@pytest.fixture(scope="session")
def osmesa():
    """Skip without libOSMesa."""
    require(library_loads("osmesa"), "libOSMesa is not installed: apt-get install libosmesa6")


@pytest.fixture(scope="session")
def drawing():
    """Skip without any library to draw with in this process."""
    require(
        os.environ.get("MUJOCO_GL"),
        "neither a display nor libOSMesa nor EGL: apt-get install libosmesa6",
    )


@pytest.fixture(scope="session")
def forward():
    """Return a drive of 1 s straight ahead."""
    from mecanum_env.simulator import BodyCommands, drive

    return drive(paper_model(), BodyCommands.constant(v_rpm=80), 1.0)
