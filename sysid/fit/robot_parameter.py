"""One number of the robot, and from when on logs count as showing it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

SHOWN: Final = 0.25
"""Relative standard error up to which a parameter counts as shown by the logs."""
EVIDENCE: Final = 10.0
"""Difference of BIC from which another parameter is worth having."""


@dataclass(frozen=True)
class RobotParameter:
    """One of the robot's numbers and what the logs say about it."""

    name: str
    value: float
    standard_error: float
    """Infinite where the logs say nothing; nan where they were not asked, or give no honest interval."""
    fitted: bool
    reason: str
