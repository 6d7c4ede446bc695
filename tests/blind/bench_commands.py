"""Command sequences for the bench, in whole rpm, one command per 0.1 s."""

from __future__ import annotations

import numpy as np

FASTEST_RPM = 115
SECONDS = 2.5
COMMANDS = round(SECONDS / 0.1)


def rich(rng: np.random.Generator) -> np.ndarray:
    """Return eight sequences, shape (8, COMMANDS): steps, reversals, near zero, random holds."""
    sign = rng.choice([-1, 1])
    slow = [2, 5, -3, 8, -6, 12, -10, 4]
    rows = [
        held(sign * np.array([rng.integers(15, 30), rng.integers(45, 60), rng.integers(75, 90), 115]), 6),
        held(-sign * np.array([rng.integers(30, 45), rng.integers(60, 75), rng.integers(90, 110), 20]), 6),
        held(sign * np.array([60, -60, 100, -100, 30, -30]), 4),
        held(rng.permutation(slow), 3),
        held(np.concatenate([[0], rng.permutation([-25, 18, -14, 9, 22, -7])]), 4),
    ]
    rows += [held(rng.integers(-FASTEST_RPM, FASTEST_RPM + 1, 8), hold) for hold in (3, 4, 5)]
    return np.array(rows, float)


def gentle(rng: np.random.Generator) -> np.ndarray:
    """Return six sequences, shape (6, COMMANDS), forward only, 30 to 70 rpm: they leave much untested."""
    return np.array([held(rng.integers(30, 71, 6), hold) for hold in (4, 4, 5, 5, 6, 6)], float)


def held(levels: np.ndarray, hold: int) -> np.ndarray:
    """Return one command at rest, then each level held for that many commands; the last goes on."""
    row = np.concatenate([[0], np.repeat(levels, hold)])[:COMMANDS]
    return np.concatenate([row, np.full(COMMANDS - row.size, row[-1])])
