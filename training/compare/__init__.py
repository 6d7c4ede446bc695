"""All controllers side by side: `python -m training.compare`.

comparison  what is played, the results of each controller, and both as text and Markdown
"""

from typing import TYPE_CHECKING

from mecanum_env.lazy import lazy_exports

if TYPE_CHECKING:
    from training.compare.comparison import Comparison, Row, compare
else:
    __getattr__, __dir__ = lazy_exports(__name__, __file__)

__all__ = ["Comparison", "Row", "compare"]
