from .numbers import PlanarRobot, planar_robot
from .plant import PlanarBatch
from .variations import LAW, Variations

__all__ = ["LAW", "PlanarBatch", "PlanarRobot", "Variations", "planar_robot"]
