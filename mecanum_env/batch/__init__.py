"""Thousands of robots without slip at once, as a program of arrays: numpy on a core, torch on a GPU.

The drives are those of `mecanum_env.law`, the Python reference of the plugin; the body is that of
`mecanum_env.mjcf.planar_spec`. `PlanarBatch` steps them; each robot has a law and effects of its own.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
