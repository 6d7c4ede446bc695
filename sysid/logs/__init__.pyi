from .findings import Finding
from .reader import read_dataset
from .runs import BenchCommand, BodyCommand, Command, Dataset, Run, Split, WheelCommand

__all__ = [
    "BenchCommand",
    "BodyCommand",
    "Command",
    "Dataset",
    "Finding",
    "Run",
    "Split",
    "WheelCommand",
    "read_dataset",
]
