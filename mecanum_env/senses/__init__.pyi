from .estimator import Estimate, Estimator
from .readings import CameraFrame, OwnReading, Senses, VariedSenses

__all__ = ["CameraFrame", "Estimate", "Estimator", "OwnReading", "Senses", "VariedSenses"]
