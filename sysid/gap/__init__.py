"""Where simulation and measurement disagree, which effect is missing, and whether adding it closes the gap.

`analyse` is the library, ``python -m sysid.gap`` the program.
"""

from typing import TYPE_CHECKING

from mecanum_env.lazy import lazy_exports

if TYPE_CHECKING:
    from sysid.gap.report.output import gap_json, write_study
    from sysid.gap.report.table import gap_table
    from sysid.gap.result import GapOptions, GapReport
    from sysid.gap.workflow import analyse
else:
    __getattr__, __dir__ = lazy_exports(__name__, __file__)

__all__ = ["GapOptions", "GapReport", "analyse", "gap_json", "gap_table", "write_study"]
