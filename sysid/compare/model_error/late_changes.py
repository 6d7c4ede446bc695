"""Changes of a robot's command that act at other times in each run: all channels show the same delay.

Each channel alone tells how much of its noise is that (`sysid.compare.noise.timing`). Taken for noise of its
own in each channel, the delay of one change would count once for each of them, and a common delay of a few
milliseconds would pass for one that is seen seven times. So each change has one unknown delay, whose response
is the slope of all channels until the next change.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mecanum_env.units import FloatArray
from sysid.compare.measured import Observations
from sysid.compare.noise import Noise, holds_of, slope_of


def late_changes(observations: Observations, noise: Noise) -> tuple[FloatArray, ...]:
    """Return what the unknown delay of each change changes, one sigma of each, (m, k) for each block.

    There are k changes in all runs of the `observations` together; `noise` says by how much they are late.
    """
    holds = [holds_of(observations, block) for block in observations.blocks]
    every = {
        (block.situation, int(hold))
        for block, own in zip(observations.blocks, holds, strict=True)
        for hold in np.unique(own)
        if block.channel in noise.timing
    }
    column = {change: index for index, change in enumerate(sorted(every))}
    found = []
    for block, own in zip(observations.blocks, holds, strict=True):
        parts = np.zeros((block.value.size, len(column)))
        late = noise.timing.get(block.channel)
        if late is not None:
            moved = late.delay_s * slope_of(block.value, block.time_s) / np.sqrt(block.independent_repeats)
            rows = np.arange(own.size)
            parts[rows, [column[block.situation, int(hold)] for hold in own]] = moved
        found.append(parts)
    return tuple(found)


def settled_noise(noise: Noise) -> Noise:
    """Return the noise without the delays of changes, which `late_changes` describes."""
    sigma = {name: noise.settled(name) if name in noise.timing else s for name, s in noise.sigma.items()}
    return replace(noise, sigma=sigma, timing={})
