from .fit import Fit, FitOptions, fit_dataset, fitted_model
from .fit.estimators import Estimate, WheelRun, estimate
from .gap import GapOptions, GapReport, analyse
from .logs import BenchCommand, BodyCommand, Dataset, Run, WheelCommand, read_dataset
from .logs.writer import write_dataset
from .online import OnlineEstimator, OnlineOptions, track

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
