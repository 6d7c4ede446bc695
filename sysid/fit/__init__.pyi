from .pipeline import Fit, FitOptions, fit_dataset
from .result import fit_json, fitted_model

__all__ = [
    "Fit",
    "FitOptions",
    "fit_dataset",
    "fit_json",
    "fitted_model",
]
