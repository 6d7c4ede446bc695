"""Fitting the wheel law to logs: `fit_dataset` is the library, ``python -m sysid.fit LOGS`` the program."""

from typing import TYPE_CHECKING

from mecanum_env.lazy import lazy_exports

if TYPE_CHECKING:
    from sysid.fit.pipeline import Fit, FitOptions, fit_dataset
    from sysid.fit.result import fit_json, fitted_model
else:
    __getattr__, __dir__ = lazy_exports(__name__, __file__)

__all__ = ["Fit", "FitOptions", "fit_dataset", "fit_json", "fitted_model"]
