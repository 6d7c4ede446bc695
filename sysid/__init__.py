"""System identification: from logs of a wheel or robot to a `model.json`, and the gap between the two."""

from typing import TYPE_CHECKING

from mecanum_env.lazy import lazy_exports

if TYPE_CHECKING:
    from sysid.fit import Fit, FitOptions, fit_dataset, fitted_model
    from sysid.fit.estimators import Estimate, WheelRun, estimate
    from sysid.gap import GapOptions, GapReport, analyse
    from sysid.logs import BenchCommand, BodyCommand, Dataset, Run, WheelCommand, read_dataset
    from sysid.logs.writer import write_dataset
    from sysid.online import OnlineEstimator, OnlineOptions, track
else:
    __getattr__, __dir__ = lazy_exports(__name__, __file__)

__all__ = [
    "BenchCommand",
    "BodyCommand",
    "Dataset",
    "Estimate",
    "Fit",
    "FitOptions",
    "GapOptions",
    "GapReport",
    "OnlineEstimator",
    "OnlineOptions",
    "Run",
    "WheelCommand",
    "WheelRun",
    "analyse",
    "estimate",
    "fit_dataset",
    "fitted_model",
    "read_dataset",
    "track",
    "write_dataset",
]
