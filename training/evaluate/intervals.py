"""Figures with what chance leaves open: shares with Wilson's interval, means with a bootstrap one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.errors import InputError
from mecanum_env.statistics import wilson_interval

CONFIDENCE: Final = 0.95
"""Of every interval."""
_RESAMPLES: Final = 2000


@dataclass(frozen=True)
class Share:
    """How many of some trials were successes, with Wilson's interval of the probability."""

    successes: int
    trials: int
    low: float
    high: float

    @property
    def value(self) -> float:
        """Successes over trials."""
        return self.successes / self.trials


@dataclass(frozen=True)
class Mean:
    """A mean over episodes, with a bootstrap interval."""

    value: float
    low: float
    high: float
    count: int
    """Episodes in which it is defined."""


def share(successes: int, trials: int) -> Share:
    """Return successes over trials with Wilson's interval.

    E. B. Wilson, "Probable inference, the law of succession, and statistical inference", 1927: unlike the
    usual +- 2 standard errors it is right for shares near 0 and 1.

    Args:
        successes: at most as many as trials.
        trials: at least one.

    Raises:
        InputError: there is no trial.
    """
    if trials < 1:
        raise InputError("a share of no trials is undefined; play at least one episode")
    return Share(successes, trials, *wilson_interval(successes, trials, CONFIDENCE))


def mean(values: Sequence[float], seed: int = 0) -> Mean | None:
    """Return the mean of values with a percentile bootstrap interval; None for no values.

    Args:
        values: one an episode.
        seed: of the resampling.
    """
    known = np.array(values, float)
    if known.size == 0:
        return None
    drawn = np.random.default_rng(seed).integers(0, known.size, (_RESAMPLES, known.size))
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(known[drawn].mean(axis=1), [tail, 100.0 - tail])
    return Mean(float(known.mean()), float(low), float(high), int(known.size))
