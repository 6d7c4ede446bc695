"""Pictures and pages of results."""

from sysid.report.fit_page import write_fit_report
from sysid.report.fit_plots import write_fit_plots

__all__ = ["write_fit_plots", "write_fit_report"]
