"""A four-wheel Mecanum robot in MuJoCo whose wheels behave as measured.

This module is imported while ``import mujoco`` loads the wheel plugin, so it stays light: nothing here
imports mujoco, gymnasium or scipy.
"""

from mecanum_env.registration import register_when_gymnasium_is_there

__version__ = "0.1.0"

register_when_gymnasium_is_there()
