"""Work in this process: tasks one after the other, simulations in threads, linear algebra with one thread."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

from threadpoolctl import threadpool_limits

from mecanum_env.parallel.tasks import T, Task, Tell

U = TypeVar("U")


def map_in_threads(work: Callable[[T], U], items: Iterable[T], jobs: int) -> list[U]:
    """Return `work` of each of the `items`, in order, `jobs` at a time, in threads of this process.

    It is for simulations, which release the interpreter lock while they step, and share what they remember.
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


class HereExecutor:
    """Runs tasks without any other process: no start-up, plain tracebacks, and no help if a task crashes."""

    def run(self, tasks: Sequence[Task[T]], tell: Tell[T] | None = None) -> list[T]:
        """Return the results in the order of the tasks; `tell` is called with each."""
        results = []
        for index, task in enumerate(tasks):
            with one_thread():
                results.append(task())
            if tell is not None:
                tell(index, results[-1])
        return results
