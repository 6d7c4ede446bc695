"""A four-wheel Mecanum robot in MuJoCo whose wheels behave as measured.

This module is imported while ``import mujoco`` loads the wheel plugin, so importing it imports neither
mujoco, gymnasium, numpy nor scipy: each public name is loaded on first use.
"""

import sys

import lazy_loader

from mecanum_env.errors import BackendError
from mecanum_env.registration import register_when_gymnasium_is_there
from mecanum_env.version import __version__ as __version__

if sys.platform == "win32":
    raise BackendError("mecanum-tankendo does not run on Windows; use Linux, macOS or WSL 2")

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


register_when_gymnasium_is_there()
