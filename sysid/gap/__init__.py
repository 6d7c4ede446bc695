"""Where simulation and measurement disagree, which effect is missing, and whether adding it closes the gap.

`analyse` is the door; `python -m sysid.gap` the command line.
"""

from sysid.gap.analyse import analyse
from sysid.gap.records import GapOptions, GapReport

__all__ = ["GapOptions", "GapReport", "analyse"]
