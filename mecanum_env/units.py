"""Units: commands and logs are in rpm of the wheel, MuJoCo works in rad/s."""

import math
from typing import Final

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

RAD_S_PER_RPM: Final = 2.0 * math.pi / 60.0
"""One revolution per minute in rad/s."""
