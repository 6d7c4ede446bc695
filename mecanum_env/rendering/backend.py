"""Choosing the graphics library before mujoco is imported.

An explicit MUJOCO_GL wins; else a display is used; else OSMesa if its library loads; else EGL. The choice is
made without mujoco, since ``MUJOCO_GL=osmesa`` without libOSMesa makes ``import mujoco`` fail with a message
about OpenGL functions.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import os
import sys
import warnings
from typing import Final

from mecanum_env.errors import BackendError

_PACKAGES: Final = {"osmesa": ("OSMesa", "libosmesa6"), "egl": ("EGL", "libegl1")}
"""Offline backend -> name of its library, Debian package."""
_ANY: Final = ("", "enable", "enabled", "on", "true", "1")
"""Values of MUJOCO_GL that leave the choice to MuJoCo."""


def choose_backend() -> str:
    """Return the backend to render with: "osmesa", "egl", "glfw" or what MUJOCO_GL says.

    Raises:
        BackendError: MUJOCO_GL names a library that is not installed, an unknown one, or none, or no backend
            is installed; the message names the Debian package.
    """
    asked = _asked()
    if asked in ("disable", "disabled", "off", "false", "0"):
        raise BackendError(f"MUJOCO_GL={asked} switches drawing off; unset it, or set it to osmesa")
    if asked in _PACKAGES and not library_loads(asked):
        raise BackendError(
            f"MUJOCO_GL={asked}, but lib{_PACKAGES[asked][0]} is not installed: "
            f"apt-get install {_PACKAGES[asked][1]}, or unset MUJOCO_GL"
        )
    if asked not in (*_PACKAGES, "glfw", "glx", "cgl", "wgl", *_ANY):
        raise BackendError(f"MUJOCO_GL={asked}, must be {', '.join(_PACKAGES)}, glfw, or unset")
    if asked not in _ANY:
        return asked
    if has_display():
        return "glfw"
    for backend in _PACKAGES:
        if library_loads(backend):
            return backend
    raise BackendError("no display and no offline renderer: apt-get install libosmesa6 (or libegl1)")


def use_backend() -> str:
    """Choose the backend, set MUJOCO_GL for the coming ``import mujoco`` and return the backend's name.

    If mujoco is already loaded, return the backend that it was loaded with.

    Raises:
        BackendError: as for `choose_backend`, or mujoco is already loaded with a backend that needs a
            display, and there is none.
    """
    if "mujoco" in sys.modules:
        loaded = _asked()
        if loaded in _PACKAGES:
            return loaded
        if not has_display():
            raise BackendError(
                "mujoco was imported before its graphics library was chosen, and there is no display; "
                "set MUJOCO_GL=osmesa, or call mecanum_env.rendering.backend.use_backend() first"
            )
        return "glfw"
    backend = choose_backend()
    os.environ["MUJOCO_GL"] = backend
    if backend in _PACKAGES:
        # PyOpenGL's own switch; if it contradicts MUJOCO_GL, the import fails.
        os.environ["PYOPENGL_PLATFORM"] = backend
    return backend


def library_loads(backend: str) -> bool:
    """Return whether the shared library of a backend, "osmesa" or "egl", can be loaded here."""
    name = ctypes.util.find_library(_PACKAGES[backend][0])
    if name is None:
        return False
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True


def _asked() -> str:
    return os.environ.get("MUJOCO_GL", "").strip().lower()


def has_display() -> bool:
    """Return whether a window can be opened: always except on Linux without DISPLAY and WAYLAND_DISPLAY."""
    is_set = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    return bool(is_set) or not sys.platform.startswith("linux")


def display_answers() -> bool:
    """Return whether a window can be opened: there is a display, and it answers."""
    if not has_display():
        return False
    import glfw

    with warnings.catch_warnings():
        # A display that does not answer is a warning of glfw's own, too.
        warnings.simplefilter("ignore")
        return bool(glfw.init())
