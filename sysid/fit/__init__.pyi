from .options import FitOptions
from .pipeline import Fit, fit_dataset
from .report import fit_json, fitted_model

__all__ = [
    "Fit",
    "FitOptions",
    "fit_dataset",
    "fit_json",
    "fitted_model",
]
