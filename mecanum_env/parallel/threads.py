"""Threads: several simulations in one process, and a single one for linear algebra."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

from threadpoolctl import threadpool_limits

T = TypeVar("T")
U = TypeVar("U")


def map_in_threads(work: Callable[[T], U], items: Iterable[T], jobs: int) -> list[U]:
    """Return `work` of each of the `items`, in order, `jobs` at a time, in threads of this process.

    For simulations, which release the interpreter lock while they step, and share what they remember.
    """
    if jobs == 1:
        return [work(item) for item in items]
    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(work, items))


@contextmanager
def one_thread() -> Iterator[None]:
    """Give linear algebra one thread, as workers have it: the last digits depend on the number."""
    with threadpool_limits(1):
        yield
