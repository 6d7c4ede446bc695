"""Drivers: one interface to robots over UDP, a serial line, or anything else."""

from training.drivers.interface import Clock, Driver, Reading, RobotSilentError, Sample
from training.drivers.named import open_driver

__all__ = ["Clock", "Driver", "Reading", "RobotSilentError", "Sample", "open_driver"]
