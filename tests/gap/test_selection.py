"""The choice of terms: finds a known pattern with its size, and nothing in noise."""

import numpy as np
import pytest

from sysid.gap.search.selection import choose

TIME = np.arange(0.0, 4.0, 0.01)
NAMES = ("1", "x", "sign", "time", "wave")
WIDTHS = (1, 1, 1, 1, 2)


def data(pattern=None, count: int = 6, seed: int = 0):
    """Return target, columns and parts of runs with a pattern of their columns (n, 6) and white noise."""
    rng = np.random.default_rng(seed)
    targets, columns = [], []
    for _ in range(count):
        x = np.repeat(rng.uniform(-1.0, 1.0, 4), 100)
        angle = np.cumsum(x) * 0.3
        rows = np.stack([np.ones(400), x, np.sign(x), TIME, np.sin(angle), np.cos(angle)], axis=1)
        columns.append(rows)
        targets.append((0.0 if pattern is None else pattern(rows)) + 0.5 * rng.standard_normal(400))
    parts = [np.arange(400 * count) // 400 == i for i in range(count)]
    return np.concatenate(targets), np.concatenate(columns), parts


def test_a_pattern_is_found_with_its_size():
    target, columns, parts = data(lambda c: 2.0 * c[:, 4] - 1.0 * c[:, 5])
    found = choose(target, columns, WIDTHS, parts)
    assert [NAMES[term] for term in found.terms] == ["wave"]
    assert found.coefficients[0] == (pytest.approx(2.0, abs=0.1), pytest.approx(-1.0, abs=0.1))
    assert found.explained == pytest.approx(2.5 / 2.75, abs=0.05)


def test_two_terms_are_told_apart_and_no_more_are_added():
    target, columns, parts = data(lambda c: 2.0 * c[:, 2] + 0.8 * c[:, 3], count=8)
    found = choose(target, columns, WIDTHS, parts)
    assert {NAMES[term] for term in found.terms} == {"sign", "time"}
    assert found.first(1).terms == found.terms[:1]


@pytest.mark.parametrize("seed", range(10))
def test_nothing_is_found_in_white_noise(seed: int):
    target, columns, parts = data(seed=seed)
    assert choose(target, columns, WIDTHS, parts) is None


@pytest.mark.parametrize("seed", range(5))
def test_nothing_is_found_in_a_random_walk_of_each_run(seed: int):
    rng = np.random.default_rng(100 + seed)
    target, columns, parts = data(lambda _: np.cumsum(0.1 * rng.standard_normal(400)), seed=seed)
    assert choose(target, columns, WIDTHS, parts) is None


def test_one_part_confirms_nothing():
    target, columns, parts = data(lambda c: c[:, 0], count=1)
    assert choose(target, columns, WIDTHS, parts) is None
