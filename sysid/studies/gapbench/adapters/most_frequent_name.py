"""The method that knows which name is hidden most often, and says it whenever something has changed."""

from __future__ import annotations

from typing import Final

from sysid.studies.gapbench.adapters.residuals import has_changed
from sysid.studies.gapbench.cases import Answer, BenchCase

NAME: Final = "acceleration_limit"
"""The name with the most forms, and so the most cases."""


def answer(case: BenchCase) -> Answer:
    """Return the most frequent name where the simulator's error has grown, else "no gap"."""
    return Answer("named", {NAME: {}}) if has_changed(case) else Answer("no_gap")
