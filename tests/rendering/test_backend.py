import os
import sys

import pytest

from mecanum_env.errors import BackendError
from mecanum_env.rendering import backend

FORGOTTEN = ("MUJOCO_GL", "PYOPENGL_PLATFORM", "DISPLAY", "WAYLAND_DISPLAY")


@pytest.fixture
def machine(monkeypatch):
    """Return a function that pretends a Linux machine with these libraries, environment and modules."""

    def pretend(libraries=(), loaded=(), **environment):
        kept = {k: v for k, v in os.environ.items() if k not in FORGOTTEN}
        monkeypatch.setattr(os, "environ", {**kept, **environment})
        monkeypatch.setattr(sys, "platform", "linux")
        monkeypatch.setattr(backend, "library_loads", lambda name: name in libraries)
        modules = {k: v for k, v in sys.modules.items() if k != "mujoco"}
        monkeypatch.setattr(sys, "modules", modules | dict.fromkeys(loaded, sys))

    return pretend


def test_what_the_user_asks_for_wins(machine):
    machine(libraries=("osmesa", "egl"), MUJOCO_GL=" EGL ", DISPLAY=":0")
    assert backend.choose_backend() == "egl"


def test_a_display_comes_before_offline_drawing(machine):
    machine(libraries=("osmesa", "egl"), DISPLAY=":0")
    assert backend.choose_backend() == "glfw"
    machine(libraries=("osmesa", "egl"), WAYLAND_DISPLAY="wayland-0")
    assert backend.choose_backend() == "glfw"


@pytest.mark.parametrize(
    ("libraries", "chosen"), [(("osmesa", "egl"), "osmesa"), (("egl",), "egl"), (("osmesa",), "osmesa")]
)
def test_osmesa_comes_before_egl(machine, libraries, chosen):
    machine(libraries=libraries)
    assert backend.choose_backend() == chosen


@pytest.mark.parametrize(("asked", "package"), [("osmesa", "libosmesa6"), ("egl", "libegl1")])
def test_a_missing_library_names_its_package(machine, asked, package):
    machine(MUJOCO_GL=asked)
    with pytest.raises(BackendError, match=f"apt-get install {package}"):
        backend.choose_backend()


def test_nothing_at_all_names_a_package(machine):
    machine()
    with pytest.raises(BackendError, match="apt-get install libosmesa6"):
        backend.choose_backend()


def test_a_name_that_mujoco_does_not_know_lists_those_it_does(machine):
    machine(libraries=("osmesa",), MUJOCO_GL="osmsea")
    with pytest.raises(BackendError, match=r"MUJOCO_GL=osmsea.*osmesa.*egl.*glfw"):
        backend.choose_backend()


@pytest.mark.parametrize("asked", ["", "1", "on"])
def test_drawing_no_matter_how_is_chosen_as_without_a_wish(machine, asked):
    machine(libraries=("osmesa", "egl"), MUJOCO_GL=asked)
    assert backend.choose_backend() == "osmesa"


def test_drawing_switched_off_is_no_backend(machine):
    machine(libraries=("osmesa", "egl"), MUJOCO_GL="off")
    with pytest.raises(BackendError, match="MUJOCO_GL=off switches drawing off"):
        backend.choose_backend()


def test_the_choice_is_left_for_mujoco_and_pyopengl_to_read(machine):
    machine(libraries=("egl",), PYOPENGL_PLATFORM="osmesa")
    assert backend.use_backend() == "egl"
    assert (os.environ["MUJOCO_GL"], os.environ["PYOPENGL_PLATFORM"]) == ("egl", "egl")


def test_a_loaded_mujoco_keeps_its_library(machine):
    machine(libraries=("egl",), loaded=("mujoco",), MUJOCO_GL="osmesa")
    assert backend.use_backend() == "osmesa"
    machine(libraries=("egl",), loaded=("mujoco",), DISPLAY=":0")
    assert backend.use_backend() == "glfw"


def test_a_mujoco_loaded_for_windows_without_a_display_cannot_draw(machine):
    machine(libraries=("osmesa", "egl"), loaded=("mujoco",))
    with pytest.raises(BackendError, match="MUJOCO_GL=osmesa"):
        backend.use_backend()
