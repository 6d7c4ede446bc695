"""All controllers side by side: `python -m training.compare`.

comparison  what is played, the results of each controller, and both as text and Markdown
"""

from training.compare.comparison import Comparison, Row, compare

__all__ = ["Comparison", "Row", "compare"]
