from .interface import Driver, Reading, RobotSilentError, Sample
from .named import open_driver

__all__ = ["Driver", "Reading", "RobotSilentError", "Sample", "open_driver"]
