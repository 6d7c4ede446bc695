"""Choosing the graphics backend before mujoco is imported.

``MUJOCO_GL=osmesa`` without libOSMesa makes ``import mujoco`` fail with a message about OpenGL functions, so
the choice is made first, here, without importing mujoco: an explicit MUJOCO_GL wins; else a display; else
OSMesa if its library loads; else EGL.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import os
import sys

from mecanum_env.errors import BackendError

_PACKAGES = {"osmesa": ("OSMesa", "libosmesa6"), "egl": ("EGL", "libegl1")}


def choose_backend() -> str:
    """Return the backend to render with: "osmesa", "egl", "glfw" or what MUJOCO_GL says.

    Raises:
        BackendError: MUJOCO_GL asks for a library that is not installed, or no backend is there at all; the
            message names the Debian package.
    """
    asked = os.environ.get("MUJOCO_GL", "").strip().lower()
    if asked:
        if asked in _PACKAGES and not library_loads(asked):
            raise BackendError(
                f"MUJOCO_GL={asked}, but lib{_PACKAGES[asked][0]} is not installed: "
                f"apt-get install {_PACKAGES[asked][1]}, or unset MUJOCO_GL"
            )
        return asked
    if not sys.platform.startswith("linux"):
        return "glfw"
    if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        return "glfw"
    for backend in ("osmesa", "egl"):
        if library_loads(backend):
            return backend
    raise BackendError("no display and no offline renderer: apt-get install libosmesa6 (or libegl1)")


def use_backend() -> str:
    """Choose the backend, set MUJOCO_GL for the coming ``import mujoco`` and return its name.

    When mujoco is loaded already its choice stands; the name returned is what it was loaded with.

    Raises:
        BackendError: as `choose_backend`.
    """
    if "mujoco" in sys.modules:
        return os.environ.get("MUJOCO_GL", "").strip().lower() or "glfw"
    backend = choose_backend()
    os.environ["MUJOCO_GL"] = backend
    return backend


def library_loads(backend: str) -> bool:
    """Return whether the shared library of "osmesa" or "egl" can be loaded here."""
    name = ctypes.util.find_library(_PACKAGES[backend][0])
    if name is None:
        return False
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True
