"""How well noise is known: from how many differences of repeats, and a mean square over command sequences.

What a robot's model errs by, and what differs from run to run, is more in one command sequence than in
another, so that its mean square is known much less well than the number of samples says. With q_k the mean
square in sequence k, the mean over n sequences has about the degrees of freedom 2 n mean(q)^2 / var(q)
(Satterthwaite, Biometrics Bulletin 2:110, 1946).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.units import FloatArray

_UNKNOWN: Final = 2.0
"""Degrees of freedom of a sequence where no others tell how much they differ: as if the mean squares were
those of two normal values each. Assumed."""
_LEAST_SPREAD: Final = 1e-3
"""Least relative variance of the mean squares, so that the degrees of freedom are finite."""


@dataclass(frozen=True)
class DifferenceCounts:
    """How many independent differences of repeats tell the noise of a robot's runs; endless: it is known."""

    every: float = math.inf
    """In all logs."""
    shared: float = math.inf
    """In the logs of the fit, in the commands of the new logs."""


KNOWN: Final = DifferenceCounts()
"""Those of a drive on the bench, where a run holds so many changes of command that these tell the noise, and
of logs without repeats, which tell nothing of it."""


def freedom_of_each(squares: FloatArray | Sequence[float]) -> float:
    """Return the degrees of freedom that each sequence adds, from the mean squares (n,) of the sequences."""
    mean = float(np.mean(squares)) if len(squares) else 0.0
    if len(squares) < 2 or mean <= 0.0:
        return _UNKNOWN
    return 2.0 / max(float(np.var(squares, ddof=1)) / mean**2, _LEAST_SPREAD)
