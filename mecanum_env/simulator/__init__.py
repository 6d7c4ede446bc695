"""Simulating a model in MuJoCo: the robot driving through commands, and a bench log replayed on one wheel.

Using these names imports mujoco; programs that draw call `mecanum_env.rendering.backend.use_backend` first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
