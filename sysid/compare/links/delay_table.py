"""How likely the delays of single changes are under a link with a common delay, a spread and lost commands.

Let l_i(d) be the likelihood of change i of the command acting d late (`sysid.compare.links.delays`), and l_i
that of it never acting. With a common delay m and a spread s of Student's t (weights w_s around m) the
likelihood of the change is

    L_i(m, s, q) = sum_k (1 - q) q^k sum_d w_s(d - m - k p) l_i(d) + q^K_i l_i:

a command that is lost, with a probability q, is repeated one period p later, and K_i repetitions follow
before the next change.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from mecanum_env.units import FloatArray
from sysid.compare.links.changes import GRID_S, LONGEST_S, STEP_S
from sysid.compare.links.common_delay import student_weights
from sysid.compare.links.delays import LinkDelays

_SCALE: Final = 0.83
"""Scale of that distribution which fits normal delays best, in their standard deviations; for uniform ones it
is 0.91."""


@dataclass(frozen=True, eq=False)
class DelayTable:
    """Likelihoods of the changes of a command under a common delay, a spread and a loss."""

    scaled: FloatArray
    """Of each change (rows) at each delay of the grid, each row divided by its largest."""
    never: FloatArray
    """Of each change never acting, on the same scales."""
    offset: FloatArray
    """Logarithms of the scales."""
    hold_s: FloatArray
    """How long each command is held [s]."""
    period_s: float
    """Time after which a lost command is repeated [s]."""
    memory: dict[float, FloatArray] = field(default_factory=dict)
    """Spread [s] -> likelihoods with that spread."""

    @property
    def repeats(self) -> FloatArray:
        """How often each command is repeated before the next change."""
        return np.asarray(np.maximum(1.0, np.floor(self.hold_s / self.period_s)))

    def smoothed(self, spread_s: float) -> FloatArray:
        """Return the likelihood of each change (rows) for each common delay of the grid, without losses."""
        if spread_s not in self.memory:
            spread = self.scaled if spread_s == 0.0 else self.scaled @ _kernel(spread_s).T
            self.memory[spread_s] = np.asarray(spread)
        return self.memory[spread_s]

    @classmethod
    def of(cls, found: LinkDelays, likelihood: FloatArray, period_s: float) -> DelayTable:
        """Return the table for some logarithms of likelihoods (n, grid) of the changes."""
        offset = np.maximum(likelihood.max(axis=1), found.lost_likelihood)
        given = np.array([change.given_s for change in found.changes])
        run = np.array([change.run for change in found.changes])
        hold = np.append(np.where(np.diff(run) == 0, np.diff(given), LONGEST_S), LONGEST_S)
        with np.errstate(under="ignore"):
            scaled = np.exp(likelihood - offset[:, None])
            never = np.exp(found.lost_likelihood - offset)
        return cls(scaled, never, offset, hold, period_s)

    def posterior_s(self, spread_s: float, mean_s: float) -> FloatArray:
        """Return the mean of each delay's posterior [s], (n,), for a spread around a common delay [s]."""
        weight = self.scaled * _kernel(spread_s)[round(mean_s / STEP_S)]
        return np.asarray((weight @ GRID_S) / np.maximum(weight.sum(axis=1), 1e-300))

    def each(self, spread_s: float, share: float) -> FloatArray:
        """Return the logarithm of the likelihood of each change (rows) for each common delay of the grid.

        The delays spread by `spread_s` [s] around it, and a `share` of the commands is lost.
        """
        at = self.smoothed(spread_s)
        total = (1.0 - share) * at
        if share > 0.0:
            weight, step, repeats = 1.0 - share, self.period_s / STEP_S, self.repeats
            for lost in range(1, math.ceil(LONGEST_S / self.period_s)):
                weight *= share
                cells = round(lost * step)
                if weight < 1e-9 or cells >= GRID_S.size:
                    break
                room = (repeats > lost)[:, None]
                total[:, : GRID_S.size - cells] += weight * room * at[:, cells:]
            total += (share**repeats * self.never)[:, None]
        return np.asarray(np.log(np.maximum(total, 1e-300)) + self.offset[:, None])

    def total(self, spread_s: float, share: float) -> FloatArray:
        """Return the logarithm of the likelihood of all changes for each common delay of the grid.

        `spread_s` [s] and `share` are as in `each`.
        """
        return np.asarray(self.each(spread_s, share).sum(axis=0))


def _kernel(spread_s: float) -> FloatArray:
    """Return the probability of each delay of the grid (columns) for each common delay (rows)."""
    return student_weights(_SCALE * spread_s)
