"""The mirror: what a policy sees and does when left and right change places.

The field, the rules and the opponent are the same on both sides of the line from one player's start to the
other's, so a state and the action in it can be learnt a second time, mirrored.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mecanum_env.units import FloatArray
from training.controllers.features import FEATURE_NAMES

_ODD_FEATURES: Final = (
    "bearing",
    "opponent's relative velocity, left",
    "tip relative to the opponent, left",
    "tip's velocity relative to the opponent, left",
)
_KEPT: Final = (1.0, -1.0, -1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0, -1.0)
"""Signs of what features keep of an observation: own velocity ahead and left, yaw rate, command ahead, left
and turn, own place x and y, cosine and sine of the heading."""

FEATURE_SIGNS: Final[FloatArray] = np.array(
    [*(-1.0 if name in _ODD_FEATURES else 1.0 for name in FEATURE_NAMES), *_KEPT]
)
"""What the features of an observation of the dodge are multiplied by in the mirror, shape (21,)."""
ACTION_SIGNS: Final[FloatArray] = np.array([1.0, -1.0, -1.0])
"""The same of a Cartesian action: ahead, left, turn."""
