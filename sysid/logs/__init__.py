"""Logs of wheels and robots: reading them strictly, and reporting what is odd in them.

`read_dataset` is the entry point; the folder format is section 1 of FORMATS.md.
"""

from typing import TYPE_CHECKING

from mecanum_env.lazy import lazy_exports

if TYPE_CHECKING:
    from sysid.logs.findings import Finding
    from sysid.logs.reader import read_dataset
    from sysid.logs.runs import BenchCommand, BodyCommand, Command, Dataset, Run, Split, WheelCommand
else:
    __getattr__, __dir__ = lazy_exports(__name__, __file__)

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
