"""Root mean squares, shares with intervals, and tables in Markdown: one definition of each."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.markdown import markdown_table
from mecanum_env.statistics import rms, wilson_interval


def test_the_rms_leaves_out_missing_samples():
    assert rms(np.array([3.0, np.nan, -4.0])) == pytest.approx(math.sqrt(12.5))
    assert math.isnan(rms(np.array([np.nan])))


def test_wilson_interval_of_a_textbook_share():
    # 15 of 148: 6.2 to 16.0 % (Newcombe 1998, Statistics in Medicine 17:857, table I, method 3).
    assert wilson_interval(15, 148) == pytest.approx((0.0624, 0.1605), abs=1e-4)


@given(st.integers(1, 2000), st.data())
def test_an_interval_contains_its_share(trials, draw):
    successes = draw.draw(st.integers(0, trials))
    low, high = wilson_interval(successes, trials)
    assert 0.0 <= low <= successes / trials <= high <= 1.0


def test_no_trials_have_no_interval():
    assert all(map(math.isnan, wilson_interval(0, 0)))


def test_a_markdown_table_escapes_bars():
    assert markdown_table(("a", "b"), [("|z|", "2")]) == "| a | b |\n| --- | --- |\n| \\|z\\| | 2 |"
