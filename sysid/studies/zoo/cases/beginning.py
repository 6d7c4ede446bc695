"""How recordings begin: with a moment of rest, or with the first command."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

_STAGE: Final = 20
"""Stage of the generator; the cases' own are below."""

FloatArray = npt.NDArray[np.float64]


def begins_with_step(seed: int) -> bool:
    """Return whether the recordings of a seed begin with the first command, as those of every second do."""
    return bool(np.random.default_rng((seed, _STAGE)).random() < 0.5)


def as_recorded(seed: int, commands: Sequence[FloatArray]) -> list[FloatArray]:
    """Return the command sequences of a case, (m,) or (m, 3) each, as its recordings hold them.

    They lack the rest before the first command if the `seed` draws that.
    """
    if not begins_with_step(seed):
        return list(commands)
    return [_without_rest(sequence) for sequence in commands]


def _without_rest(sequence: FloatArray) -> FloatArray:
    moves = np.any(sequence.reshape(len(sequence), -1) != 0.0, axis=1)
    return sequence[int(np.argmax(moves)) :] if np.any(moves) else sequence
