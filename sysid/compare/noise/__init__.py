"""The noise of each channel: white, correlated, larger after a change of command, or lasting for a hold."""

from sysid.compare.noise.beside_model import Deviations, noise_beside_model
from sysid.compare.noise.estimate import Noise, measure_noise
from sysid.compare.noise.lasting import holds_of, with_lasting
from sysid.compare.noise.timing import slope_of

__all__ = [
    "Deviations",
    "Noise",
    "holds_of",
    "measure_noise",
    "noise_beside_model",
    "slope_of",
    "with_lasting",
]
