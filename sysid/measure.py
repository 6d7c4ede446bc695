"""Time, memory and progress of long work."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable
from typing import TypeVar

Progress = Callable[[str], None]
"""Called with what comes next, before it begins."""

T = TypeVar("T")


def silent(message: str) -> None:
    """Ignore progress; `message` is what would be shown."""
    del message


def seconds_of(work: Callable[[], T]) -> tuple[T, float]:
    """Return the result of `work` and the wall-clock seconds it took."""
    start = time.perf_counter()
    result = work()
    return result, time.perf_counter() - start


def peak_memory_mib(work: Callable[[], object]) -> float:
    """Return the largest memory that `work` held at once [MiB], Python objects and numpy arrays.

    Tracing slows the work down, so time it in another call.
    """
    tracing = tracemalloc.is_tracing()
    if not tracing:
        tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        work()
        _, peak = tracemalloc.get_traced_memory()
    finally:
        if not tracing:
            tracemalloc.stop()
    return (peak - before) / 2**20
