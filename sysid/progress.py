"""Progress, time and memory of long work."""

from __future__ import annotations

import math
import sys
import time
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final, TypeVar

from tqdm import tqdm

Progress = Callable[[str], None]
"""A function that is called with the name of each stage before the stage begins.

Within a long stage it is called again, with the name of the stage, a colon and how far the stage is.
"""
_QUIET_S: Final = 10.0
"""Least time between two lines about one stage where there is no terminal [s]."""

T = TypeVar("T")


def silent(message: str) -> None:
    """Ignore the `message` of a stage."""
    del message


def within(progress: Progress, stage: str) -> Progress:
    """Return a function that tells `progress` how far a stage is."""
    return lambda message: progress(f"{stage}: {message}")


@contextmanager
def stage_bar(stages: int) -> Iterator[Progress]:
    """Show up to `stages` stages on stderr: a bar on a terminal, else (a log file, CI) lines with the time.

    How far a stage is takes the place of its name on the bar, and a line of its own every ten seconds.
    """
    if not sys.stderr.isatty():
        began = time.perf_counter()
        stage, told = "", -math.inf

        def line(message: str) -> None:
            nonlocal stage, told
            now = time.perf_counter()
            if _is_within(message, stage) and now - told < _QUIET_S:
                return
            if not _is_within(message, stage):
                stage = message
            told = now
            print(f"[{now - began:6.1f} s] {message}", file=sys.stderr)

        yield line
        return
    layout = "{percentage:3.0f}% |{bar:20}| [{elapsed}] {desc}"
    with tqdm(total=stages, bar_format=layout, file=sys.stderr) as bar:
        begun, shown = 0, ""

        def advance(message: str) -> None:
            nonlocal begun, shown
            bar.set_description_str(message, refresh=False)
            if not _is_within(message, shown):
                bar.update(min(begun, 1))
                begun, shown = begun + 1, message
            bar.refresh()

        yield advance
        bar.set_description_str("done", refresh=False)
        bar.update(max(0, stages - int(bar.n)))


def _is_within(message: str, stage: str) -> bool:
    return bool(stage) and message.startswith(f"{stage}: ")


def seconds_of(work: Callable[[], T]) -> tuple[T, float]:
    """Return the result of `work` and the wall-clock seconds it took."""
    start = time.perf_counter()
    result = work()
    return result, time.perf_counter() - start


def peak_memory_mib(work: Callable[[], object]) -> float:
    """Return the peak memory [MiB] of Python objects and numpy arrays during `work`.

    Tracing slows the work down, so measure its time in another call.
    """
    return with_peak_memory(work)[1]


def with_peak_memory(work: Callable[[], T]) -> tuple[T, float]:
    """Return the result of `work` and its peak memory [MiB], as `peak_memory_mib` measures it."""
    tracing = tracemalloc.is_tracing()
    if not tracing:
        tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        result = work()
        _, peak = tracemalloc.get_traced_memory()
    finally:
        if not tracing:
            tracemalloc.stop()
    return result, (peak - before) / 2**20
