"""Thousands of robots without slip at once, as a program of arrays: numpy on a core, torch on a GPU.

The drives are those of `mecanum_env.law`, the Python reference of the plugin; the body is that of
`mecanum_env.mjcf.planar_spec`. `PlanarBatch` steps them; each robot has a law and effects of its own.
"""

from mecanum_env.batch.numbers import PlanarRobot, planar_robot
from mecanum_env.batch.plant import PlanarBatch

__all__ = ["PlanarBatch", "PlanarRobot", "planar_robot"]
