"""Where simulation and measurement disagree, which effect is missing, and whether adding it closes the gap.

`analyse` runs a study; `python -m sysid.gap` is its command line. Modules import only those to their left:
result < wording, checks < search < design < report < workflow < __main__. `search` decides which effects are
missing, `design` finds the next experiment, `report` puts out the results.
"""

from typing import TYPE_CHECKING

from mecanum_env.lazy import lazy_exports

if TYPE_CHECKING:
    from sysid.gap.report.output import gap_json, gap_table, write_study
    from sysid.gap.result import GapOptions, GapReport
    from sysid.gap.workflow import analyse
else:
    __getattr__, __dir__ = lazy_exports(__name__, __file__)

__all__ = ["GapOptions", "GapReport", "analyse", "gap_json", "gap_table", "write_study"]
