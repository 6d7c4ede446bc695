"""Whether logs hold commands that other logs hold, too, so that a model's error in these is known.

A law errs in its own way after each change of command and at each speed. Where a change goes from a level to
another that the logs of the fit have in common, and no command is held for longer, the model's error was
measured in these very commands; in others it may be several times as large.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mecanum_env.units import FloatArray
from sysid.compare.measured import Observations, changes_from_rest

_ALIKE: Final = 0.02
"""Distance of two levels, relative to the largest one, up to which they count as the same. Assumed: what an
error that goes with the speed differs by is then small beside the error itself."""
_LONGER: Final = 1.2
"""How much longer a command may be held. Assumed: stamps and delays move the ends of a hold."""
_MOST_OTHERS: Final = 0.1
"""Largest share of changes that the other logs lack. Assumed: a part of this size adds little to a mean."""


def are_familiar(observations: Observations, others: Observations) -> bool:
    """Return whether the changes of command of some observations are among those of others."""
    ours, held_s = _changes(observations)
    theirs, longest_s = _changes(others)
    if not len(ours) or not len(theirs) or held_s > _LONGER * longest_s:
        return False
    reach = _ALIKE * float(np.max(np.abs(theirs)))
    apart = [float(np.min(np.max(np.abs(theirs - one), axis=1))) for one in ours]
    return float(np.mean(np.array(apart) > reach)) <= _MOST_OTHERS


def _changes(observations: Observations) -> tuple[FloatArray, float]:
    """Return the levels around each change of command, (m, 2 x wheels), and the longest hold [s]."""
    found, longest_s = [], 0.0
    for situation in observations.situations:
        run = situation.runs[0]
        times, levels = changes_from_rest(run)
        found.append(np.concatenate([levels[:-1], levels[1:]], axis=1))
        longest_s = max(longest_s, float(np.max(np.diff([*times, run.time_s[-1]]))))
    return np.concatenate(found), longest_s
