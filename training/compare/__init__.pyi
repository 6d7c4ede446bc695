from .comparison import Comparison, Row, compare_controllers

__all__ = [
    "Comparison",
    "Row",
    "compare_controllers",
]
