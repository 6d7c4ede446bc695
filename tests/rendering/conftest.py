"""What tests that draw share: a short drive, and a skip where there is no software renderer."""

import os

import pytest

from mecanum_env.model import paper_model
from mecanum_env.rendering.backend import library_loads


@pytest.fixture(scope="session")
def osmesa():
    """Skip without libOSMesa; fail where CI runs, which installs it."""
    if not library_loads("osmesa"):
        reason = "libOSMesa is not installed: apt-get install libosmesa6"
        if os.environ.get("CI"):
            pytest.fail(reason)
        pytest.skip(reason)


@pytest.fixture(scope="session")
def drawing():
    """Skip without any library to draw with in this process; fail where CI runs."""
    if not os.environ.get("MUJOCO_GL"):
        reason = "neither a display nor libOSMesa nor EGL: apt-get install libosmesa6"
        if os.environ.get("CI"):
            pytest.fail(reason)
        pytest.skip(reason)


@pytest.fixture(scope="session")
def forward():
    """Return a drive of 1 s straight ahead."""
    from mecanum_env.simulator import BodyCommands, drive

    return drive(paper_model(), BodyCommands.constant(v_rpm=80), 1.0)
