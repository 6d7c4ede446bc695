"""The type of the arrays, and how functions on them are compiled."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np

FloatArray = np.ndarray[Any, np.dtype[np.float64]]


def _digest() -> str:
    """Return a digest of all sources of the drives and robots."""
    zoo = Path(__file__).parents[1]
    sources = sorted(path for room in ("drives", "robots") for path in (zoo / room).glob("*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]


# Numba compiles a function anew when its own file has changed, but not when a file has whose functions it
# calls. So what was compiled from other sources is in another folder.
numba.config.CACHE_DIR = str(Path(__file__).parent / "__pycache__" / _digest())

compiled: Callable[[Any], Any] = numba.njit(cache=True)
"""Decorator of a compiled function; what is compiled once is kept."""
