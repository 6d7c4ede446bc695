"""What a fit puts out: `model.json` and `fit.json`, the table, the page and the picture."""

from sysid.fit.report.output import fit_json, fitted_model
from sysid.fit.report.page import fit_table, write_fit_report
from sysid.fit.report.plots import write_fit_plots

__all__ = [
    "fit_json",
    "fit_table",
    "fitted_model",
    "write_fit_plots",
    "write_fit_report",
]
