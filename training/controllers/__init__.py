"""Controllers that run on the simulator and, unchanged, in a real robot's loop."""

from training.controllers.pose import PoseController

__all__ = ["PoseController"]
