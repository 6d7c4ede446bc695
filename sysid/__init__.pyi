from .fit import FitOptions, fit_dataset, fitted_model
from .fit.estimators import estimate
from .logs import Dataset, Run, read_dataset
from .logs.writer import write_dataset
from .online import OnlineEstimator, OnlineOptions, first_order_law

__all__ = [
    "Dataset",
    "FitOptions",
    "OnlineEstimator",
    "OnlineOptions",
    "Run",
    "estimate",
    "first_order_law",
    "fit_dataset",
    "fitted_model",
    "read_dataset",
    "write_dataset",
]
