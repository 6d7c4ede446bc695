"""All controllers side by side: `python -m training.compare`.

run    what is played, and the figures of each controller
table  the same as text and Markdown
"""

from training.compare.comparison import Comparison, Row, compare

__all__ = ["Comparison", "Row", "compare"]
