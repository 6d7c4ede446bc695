"""What numpy's arrays and torch's tensors have in common, so that one code computes with either.

Functions that take arrays "of either kind" call only what both modules have by one name, such as `where`,
`clip`, `isfinite` and `copysign`, with a scalar where both accept one.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from mecanum_env.units import FloatArray


def namespace(array: Any) -> Any:
    """Return the module whose functions work on an `array`: torch for its tensors, else numpy."""
    return sys.modules["torch"] if type(array).__module__ == "torch" else np


def floats(values: Any) -> Any:
    """Return `values` as an array of numbers, or as they are if they are a tensor."""
    return values if namespace(values) is not np else np.asarray(values, float)


def sines(angles: Any) -> Any:
    """Return the sine of each of the `angles` [rad], by the C library for numpy, as the plugin does."""
    return _each(math.sin, angles) if namespace(angles) is np else namespace(angles).sin(angles)


def exponentials(values: Any) -> Any:
    """Return the exponential of each of the `values`, by the C library for numpy, as the plugin does."""
    return _each(math.exp, values) if namespace(values) is np else namespace(values).exp(values)


def _each(function: Callable[[float], float], values: FloatArray) -> FloatArray:
    """Return a function of the C library for each value: numpy's own differ from it in the last bit."""
    return np.array([function(x) for x in values.ravel().tolist()], float).reshape(values.shape)
