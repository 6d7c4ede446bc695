"""Which gaps in the gear a fit keeps, and whether they predict other commands better."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import pytest

from sysid.fit.effects import drive


@pytest.fixture(scope="module")
def gaps(benchmark_of: Callable[[str], ModuleType]) -> ModuleType:
    return benchmark_of("fit_gaps")


def test_the_page_tells_what_gaps_that_are_kept_and_left_out_do_to_other_commands(gaps: ModuleType) -> None:
    kept, left = 0.99 - drive.GAP_WORTH, 1.01 - drive.GAP_WORTH
    rows = [
        gaps.Gap(1, "p", 1.0, 1.1, kept, 0.5, 2.0),
        gaps.Gap(2, "pi", 0.0, 30.0, kept, 1.0, 1.0),
        gaps.Gap(3, "pid", 0.0, 20.0, left, 6.0, 1.5),
    ]
    text = "\n".join(gaps.page(rows))
    assert "0.50 times that without it for the 2 drives where it is kept" in text
    assert "4.00 times for the 1 where it is left out" in text
    assert "| 3 | pid | 0 | 20 | -9.0% | 6 | 1.5 |" in text
