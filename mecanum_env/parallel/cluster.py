"""Tasks on a Ray cluster, of this machine or of many (https://docs.ray.io)."""

from __future__ import annotations

import logging
import os
import socket
from collections import deque
from collections.abc import Sequence
from typing import Any, Final

from mecanum_env.errors import BackendError, InputError
from mecanum_env.parallel.same_code import code_fingerprint
from mecanum_env.parallel.tasks import (
    MOST_TRIES,
    T,
    Task,
    Tell,
    WorkerLostError,
    answer,
    lost,
    packed,
    unpacked,
)

_ADDRESS: Final = "RAY_ADDRESS"


_PATIENCE_S: Final = 10.0
"""Time in which a cluster must accept a connection [s]; Ray itself waits for minutes."""


class RayExecutor:
    """Runs tasks on a Ray cluster, one processor each.

    A cluster that this process has joined already is used; otherwise one is joined or started until `close`.

    Args:
        jobs: tasks at a time, and processors of a local cluster; 0: as many as the cluster has processors.
        address: of a running cluster; by default RAY_ADDRESS, and without that a local cluster is started.

    Raises:
        InputError: there is no cluster at the address.
        BackendError: Ray does not start on this machine.
    """

    def __init__(self, jobs: int, address: str | None) -> None:
        # Imported here: nothing else needs it, and it takes a second.
        import ray

        self._ray: Any = ray
        self._jobs = jobs
        self._ours = not ray.is_initialized()
        if self._ours:
            self._join_or_start(address or os.environ.get(_ADDRESS) or "local")
        # Ray begins a task again whose worker or node has died.
        self._answer = ray.remote(max_retries=MOST_TRIES - 1, num_cpus=1)(answer)

    def _join_or_start(self, address: str) -> None:
        settings: dict[str, Any] = {"logging_level": logging.ERROR, "log_to_driver": False}
        if address == "local":
            settings |= {"num_cpus": self._jobs or os.cpu_count(), "include_dashboard": False}
        try:
            _require_reachable(address)
            self._ray.init(address, **settings)
        except Exception as error:  # Ray raises a bare one where a machine is too busy to start it in time.
            if address == "local":
                raise BackendError(f"Ray does not start on this machine: {error}") from error
            raise InputError(
                f"no Ray cluster at {address} ({error}); start one with `ray start --head`, or leave out "
                f"--ray-address and {_ADDRESS} to work on this machine"
            ) from error

    def run(self, tasks: Sequence[Task[T]], tell: Tell[T] | None = None) -> list[T]:
        """Return the results in the order of the tasks; `tell` is called with each as it comes.

        Raises:
            WorkerLostError: a task lost its worker `MOST_TRIES` times.
        """
        code = code_fingerprint()
        waiting, results = deque(range(len(tasks))), dict[int, T]()
        running: dict[Any, int] = {}
        # Without a limit Ray queues the tasks itself, and a cluster that grows sees how many wait.
        most = self._jobs or len(tasks)
        try:
            while len(results) < len(tasks):
                while waiting and len(running) < most:
                    index = waiting.popleft()
                    running[self._answer.remote(packed(tasks[index], code))] = index
                for reference in self._finished(list(running)):
                    index = running.pop(reference)
                    results[index] = self._result(reference, tasks[index])
                    if tell is not None:
                        tell(index, results[index])
        finally:
            for reference in running:
                self._ray.cancel(reference)
        return [results[index] for index in range(len(tasks))]

    def close(self) -> None:
        """Leave the cluster; a local one ends."""
        if self._ours:
            self._ray.shutdown()

    def _finished(self, running: list[Any]) -> list[Any]:
        """Return all references that are ready, at least one."""
        self._ray.wait(running, num_returns=1, fetch_local=False)
        ready: list[Any] = self._ray.wait(running, num_returns=len(running), timeout=0, fetch_local=False)[0]
        return ready

    def _result(self, reference: Any, task: Task[T]) -> T:
        errors = self._ray.exceptions
        try:
            answered = self._ray.get(reference)
        except errors.RayTaskError as error:
            # `answer` raises nothing: not even its module was there.
            raise InputError(
                f"a node of the Ray cluster cannot work for this program; install the same wheel on every "
                f"node ({error})"
            ) from error
        except errors.RayError as error:
            raise self._lost(task, error) from error
        found: T = unpacked(answered)
        return found

    def _lost(self, task: Task[Any], error: Exception) -> WorkerLostError:
        return lost(task.name, type(error).__name__)


def _require_reachable(address: str) -> None:
    """Connect to an address such as "10.0.0.1:6379"; words such as "auto" are left to Ray."""
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if colon:
        socket.create_connection((host.strip("[]"), int(port)), _PATIENCE_S).close()
