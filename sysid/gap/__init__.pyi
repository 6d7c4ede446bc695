from .report.output import gap_json, gap_table, write_study
from .result import GapOptions, GapReport
from .workflow import analyse

__all__ = ["GapOptions", "GapReport", "analyse", "gap_json", "gap_table", "write_study"]
