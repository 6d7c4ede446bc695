"""Pictures and pages of results."""

from sysid.report.fit_page import write_fit_report
from sysid.report.fit_plots import write_fit_plots
from sysid.report.gap_page import write_gap_report

__all__ = ["write_fit_plots", "write_fit_report", "write_gap_report"]
