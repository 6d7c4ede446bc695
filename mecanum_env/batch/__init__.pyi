from .numbers import PlanarRobot, planar_robot
from .plant import PlanarBatch

__all__ = ["PlanarBatch", "PlanarRobot", "planar_robot"]
