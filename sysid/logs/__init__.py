"""Logs of wheels and robots: reading them strictly, and reporting what is odd in them.

`read_dataset` is the entry point; the folder format is section 1 of FORMATS.md.
"""

from sysid.logs.findings import Finding
from sysid.logs.reader import read_dataset
from sysid.logs.runs import BenchCommand, BodyCommand, Command, Dataset, Run, Split, WheelCommand

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
