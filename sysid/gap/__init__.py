"""Where simulation and measurement disagree, which effect is missing, and whether adding it closes the gap.

`analyse` is the door; `python -m sysid.gap` the command line.
"""

from sysid.gap.result import GapOptions, GapReport
from sysid.gap.workflow import analyse

__all__ = ["GapOptions", "GapReport", "analyse"]
