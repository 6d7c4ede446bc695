"""What draws of the same change share, without most of what chance does in each of them.

A change that is simulated on rollers is what the change does, and what rollers do that meet the floor a
little earlier or later after any change. A search over sizes would find the size at which chance looks most
like the logs. With d_1 .. d_n the change in n draws of the rollers' angles, and chance independent in each of
them, the mean of d_i . d_j over all pairs is the square of what the change does, whatever chance adds to the
square of the mean of all. The ratio of both is the factor on the mean that leaves the least squared error
(Wiener, 1949).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mecanum_env.units import FloatArray


def shared_part(draws: Sequence[FloatArray]) -> FloatArray:
    """Return the mean (N,) of draws (N,) of a change, shrunk as far as they do not agree.

    It is 0 where the draws have nothing in common. A single draw is kept: nothing tells what chance does in
    it.
    """
    count, mean = len(draws), np.mean(draws, axis=0)
    square = float(mean @ mean)
    if count == 1 or square == 0.0:
        return np.asarray(mean)
    own = float(np.mean([draw @ draw for draw in draws])) / count
    shared = (square - own) * count / (count - 1)
    return np.asarray(mean * min(1.0, max(0.0, shared / square)))
