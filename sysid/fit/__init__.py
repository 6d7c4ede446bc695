"""Fitting the wheel law to logs: `fit_dataset` is the library, ``python -m sysid.fit LOGS`` the program."""

from sysid.fit.pipeline import Fit, FitOptions, fit_dataset
from sysid.fit.result import fit_json, fitted_model

__all__ = ["Fit", "FitOptions", "fit_dataset", "fit_json", "fitted_model"]
