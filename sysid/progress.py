"""Progress, time and memory of long work."""

from __future__ import annotations

import sys
import time
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from tqdm import tqdm

Progress = Callable[[str], None]
"""A function that is called with the name of each stage before the stage begins."""

T = TypeVar("T")


def silent(message: str) -> None:
    """Ignore the `message` of a stage."""
    del message


@contextmanager
def stage_bar(stages: int) -> Iterator[Progress]:
    """Show up to `stages` stages on stderr: a bar on a terminal, else (a log file, CI) one line per stage."""
    if not sys.stderr.isatty():
        began = time.perf_counter()
        yield lambda text: print(f"[{time.perf_counter() - began:6.1f} s] {text}", file=sys.stderr)
        return
    layout = "{percentage:3.0f}% |{bar:20}| [{elapsed}] {desc}"
    with tqdm(total=stages, bar_format=layout, file=sys.stderr) as bar:
        begun = 0

        def advance(message: str) -> None:
            nonlocal begun
            bar.set_description_str(message, refresh=False)
            bar.update(min(begun, 1))
            bar.refresh()
            begun += 1

        yield advance
        bar.set_description_str("done", refresh=False)
        bar.update(max(0, stages - int(bar.n)))


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
