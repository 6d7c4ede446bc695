"""Success over seeds and episodes: its interval counts both."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def page(benchmark_of):
    return benchmark_of("learning_page")


def test_seeds_that_agree_leave_the_doubt_of_the_episodes(page):
    value, low, high = page.success_of([0.5, 0.5, 0.5], episodes=100).interval()
    assert value == 0.5
    assert high - value == value - low == pytest.approx(1.96 * 0.05, rel=1e-3)


def test_many_episodes_leave_that_of_the_seeds(page):
    value, low, _ = page.success_of([0.4, 0.5, 0.6], episodes=10**9).interval()
    assert value - low == pytest.approx(4.303 * 0.1 / np.sqrt(3), rel=1e-3)


def test_a_single_seed_has_no_interval(page):
    assert page.success_of([0.4], episodes=100).text() == "0.40 (nan .. nan)"


def test_a_difference_is_shown_only_beyond_its_interval(page):
    better, worse = page.success_of([0.9, 0.9, 0.9], 200), page.success_of([0.5, 0.5, 0.5], 200)
    assert (better.minus(worse).sign, worse.minus(better).sign, better.minus(better).sign) == (1, -1, 0)
    near = page.success_of([0.88, 0.88, 0.88], 200)
    assert better.minus(near).sign == 0


def test_the_mean_of_rows_is_surer_than_a_row(page):
    rows = {name: page.success_of([0.5, 0.5], 100) for name in "abcd"}
    assert page.over_rows(rows).variance == pytest.approx(rows["a"].variance / 4)
