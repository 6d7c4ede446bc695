"""Where simulation and measurement disagree, which effect is missing, and whether adding it closes the gap.

`analyse` is the door; `python -m sysid.gap` the command line.
"""

from typing import TYPE_CHECKING

from mecanum_env.lazy import lazy_exports

if TYPE_CHECKING:
    from sysid.gap.result import GapOptions, GapReport
    from sysid.gap.workflow import analyse
else:
    __getattr__, __dir__ = lazy_exports(__name__, __file__)

__all__ = ["GapOptions", "GapReport", "analyse"]
