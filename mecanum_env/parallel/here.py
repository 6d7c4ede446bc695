"""Tasks one after the other in the asking process."""

from __future__ import annotations

from collections.abc import Sequence

from mecanum_env.parallel.tasks import T, Task, Tell
from mecanum_env.parallel.threads import one_thread


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
