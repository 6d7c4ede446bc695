"""Where tasks run, as a user chooses it, and the executor for it."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

from mecanum_env.errors import InputError, install_command, require_one_of
from mecanum_env.parallel.tasks import Executor, T, Task, Tell


@dataclass(frozen=True)
class Workers:
    """Where tasks run; results do not depend on it."""

    backend: Literal["local", "ray"] = "local"
    """local: processes on this machine; ray: a Ray cluster (docs/cluster.md)."""
    jobs: int = 0
    """Tasks at a time, which does not change the result; 0: as many as there are processors."""
    ray_address: str | None = None
    """Ray cluster to join; default: RAY_ADDRESS, or without it a new one on this machine."""

    def require_usable(self) -> None:
        """Refuse what cannot be, before any work begins.

        Raises:
            InputError: an unknown or missing backend, a negative number of jobs, or an address without Ray.
        """
        require_one_of("backend", self.backend, ("local", "ray"))
        if self.jobs < 0:
            raise InputError(f"jobs = {self.jobs}, must be at least 0 (0: all processors)")
        if self.backend == "ray" and importlib.util.find_spec("ray") is None:
            raise InputError(f"backend = ray: Ray is missing; {install_command('ray')}")
        if self.ray_address is not None and self.backend != "ray":
            raise InputError(f"ray-address = {self.ray_address}: needs --backend ray")


@contextmanager
def executor(workers: Workers) -> Iterator[Executor]:
    """Yield an executor, whose processes stay for several calls of `run`; leaving the block ends them.

    One local job is done in this process.

    Raises:
        InputError: workers that cannot be, or no cluster at the address.
    """
    # Imported here, so that the help of a program waits for neither processes nor sockets.
    from mecanum_env.parallel.cluster import RayExecutor
    from mecanum_env.parallel.here import HereExecutor
    from mecanum_env.parallel.local import LocalExecutor

    workers.require_usable()
    jobs = workers.jobs
    if workers.backend == "local":
        jobs = jobs or os.cpu_count() or 1
        if jobs == 1:
            yield HereExecutor()
            return
    pool = RayExecutor(jobs, workers.ray_address) if workers.backend == "ray" else LocalExecutor(jobs)
    try:
        yield pool
    finally:
        pool.close()


def run_tasks(
    tasks: Sequence[Task[T]], workers: Workers | None = None, tell: Tell[T] | None = None
) -> list[T]:
    """Return the results of tasks, in their order, done by `workers`; see `Executor.run`.

    Args:
        tasks: each independent of the others.
        workers: where they run; by default on all processors of this machine.
        tell: called with the index and the result of each task as results come.

    Raises:
        WorkerLostError: a task lost its worker process several times.
        InputError: see `executor`.
    """
    if not tasks:
        return []
    with executor(workers or Workers()) as pool:
        return pool.run(tasks, tell)
