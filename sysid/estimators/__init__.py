"""Methods that identify the wheel law from runs, all behind one interface (`estimate`)."""

from sysid.estimators.interface import Estimate, Method, Options, StartResult
from sysid.estimators.output_error import output_error
from sysid.estimators.runs import WheelRun

__all__ = ["Estimate", "Method", "Options", "StartResult", "WheelRun", "output_error"]
