"""What every page of results shares: the look, figures that zoom, one file without network."""

from mecanum_env.report.page import Trace, figure, report_available, write_page

__all__ = ["Trace", "figure", "report_available", "write_page"]
