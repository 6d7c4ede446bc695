"""How large innovations usually are, and whether they have just grown: noise, outlier or change of law."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

_MEDIAN_OF_THREE: Final = 0.70346
"""E m^2 for m the median of three |z|, z standard normal: 6 int z^2 G (1 - G) g dz, G and g those of |z|."""
_FASTEST_GROWTH: Final = (25.0, 6.0)
"""Power of one sample is clipped at this multiple of the average it enters: recent, usual."""
_SMALLEST_RPM: Final = 1e-3


@dataclass
class NoiseTracker:
    """Averages of innovation power over a recent and a usual span, in rpm^2.

    Each sample enters as the median of the last three magnitudes: a lone outlier never counts, a changed law,
    which disturbs samples in a row, counts from its second sample on. (Outliers of up to about a tenth of the
    samples leave both averages near the truth.)
    """

    recent_rpm2: float
    usual_rpm2: float
    floor_rpm2: float
    last: float = 0.0
    before_last: float = 0.0

    @staticmethod
    def start(noise_rpm: float, quantum_rpm: float) -> NoiseTracker:
        """Return a tracker that expects `noise_rpm` and never less than the noise of rounding."""
        floor = max(quantum_rpm / math.sqrt(12.0), _SMALLEST_RPM)
        power = max(noise_rpm, floor) ** 2
        return NoiseTracker(power, power, floor**2)

    @property
    def ratio(self) -> float:
        """Recent power over usual power: about 1 while the law fits as well as it did."""
        return self.recent_rpm2 / self.usual_rpm2

    def update(self, innovation_rpm: float, recent_samples: float, usual_samples: float) -> None:
        """Take in one innovation.

        Args:
            innovation_rpm: measured minus predicted [rpm].
            recent_samples: length of the recent average.
            usual_samples: length of the usual average.
        """
        size = abs(innovation_rpm)
        typical = sorted((size, self.last, self.before_last))[1]
        self.last, self.before_last = size, self.last
        power = typical * typical / _MEDIAN_OF_THREE
        fast, slow = _FASTEST_GROWTH
        self.recent_rpm2 += (min(power, fast * self.recent_rpm2) - self.recent_rpm2) / recent_samples
        self.usual_rpm2 += (min(power, slow * self.usual_rpm2) - self.usual_rpm2) / usual_samples
        self.recent_rpm2 = max(self.recent_rpm2, self.floor_rpm2)
        self.usual_rpm2 = max(self.usual_rpm2, self.floor_rpm2)
