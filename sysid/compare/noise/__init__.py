"""The noise of each channel: white, correlated, larger after a change of command, or lasting for a hold."""

from sysid.compare.noise.estimate import Noise, measure_noise
from sysid.compare.noise.lasting import holds_of, with_lasting

__all__ = [
    "Noise",
    "holds_of",
    "measure_noise",
    "with_lasting",
]
