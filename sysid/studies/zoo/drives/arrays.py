"""The type of the arrays, and how functions on them are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np

FloatArray = np.ndarray[Any, np.dtype[np.float64]]

compiled: Callable[[Any], Any] = numba.njit(cache=True)
"""Decorator of a compiled function; what is compiled once is kept beside its file."""
