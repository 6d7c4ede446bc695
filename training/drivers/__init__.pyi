from .interface import Clock, Driver, Reading, RobotSilentError, Sample
from .named import open_driver

__all__ = ["Clock", "Driver", "Reading", "RobotSilentError", "Sample", "open_driver"]
