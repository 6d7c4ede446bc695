"""Worker processes on this machine.

Each has one task at a time and a pipe of its own, so that it is known which task the death of a process
interrupts, and no other task is disturbed.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from types import FrameType
from typing import Any, Final

from mecanum_env.errors import InputError
from mecanum_env.parallel.same_code import code_fingerprint
from mecanum_env.parallel.tasks import GUARD, MOST_TRIES, T, Task, Tell, answer, lost, packed, unpacked

_GRACE_S: Final = 10.0
"""Time in which an interrupted task may remove its temporary files [s]."""
_THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class LocalExecutor:
    """Runs tasks in `jobs` processes, which start when they are needed and stay until `close`."""

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self._workers: list[_Worker] = []

    def run(self, tasks: Sequence[Task[T]], tell: Tell[T] | None = None) -> list[T]:
        """Return the results in the order of the tasks; `tell` is called with each as it comes.

        A task whose worker ends without an answer is begun again by another worker.

        Raises:
            WorkerLostError: a task lost its worker `MOST_TRIES` times.
        """
        code = code_fingerprint()
        waiting, tries = deque(range(len(tasks))), Counter[int]()
        running: dict[_Worker, int] = {}
        results: dict[int, T] = {}
        try:
            while len(results) < len(tasks):
                while waiting and len(running) < self._jobs:
                    worker, index = self._idle(running), waiting.popleft()
                    worker.ask(packed(tasks[index], code))
                    running[worker] = index
                for worker in _answered(list(running)):
                    index = running.pop(worker)
                    answered = worker.answer()
                    if answered is None:
                        self._workers.remove(worker)
                        tries[index] += 1
                        if tries[index] == MOST_TRIES:
                            raise lost(tasks[index].name, worker.how_it_ended())
                        waiting.appendleft(index)
                        continue
                    results[index] = unpacked(answered)
                    if tell is not None:
                        tell(index, results[index])
        except BaseException:
            # Answers to what still runs would be taken for those of the next tasks.
            self.close()
            raise
        return [results[index] for index in range(len(tasks))]

    def close(self) -> None:
        """End all workers at once, whatever they do."""
        workers, self._workers = self._workers, []
        for worker in workers:
            worker.interrupt()
        for worker in workers:
            worker.end()

    def _idle(self, running: dict[_Worker, int]) -> _Worker:
        for worker in self._workers:
            if worker not in running:
                return worker
        worker = _Worker()
        # Noted first: Ctrl-C during the start must end it, too.
        self._workers.append(worker)
        worker.start()
        return worker


class _Worker:
    """One process and the pipe to it."""

    def __init__(self) -> None:
        # Spawned, not forked: a fork would break the threads of MuJoCo and its graphics libraries.
        context = multiprocessing.get_context("spawn")
        self.connection, self._theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(self._theirs,), daemon=True)

    def start(self) -> None:
        """Start the process.

        Raises:
            InputError: this process is itself a worker that still imports the user's script.
        """
        with environment_of_workers():
            try:
                self.process.start()
            except RuntimeError as error:
                if "bootstrapping" not in str(error):
                    raise
                raise InputError(f"a script's worker processes import it, so it must {GUARD}") from error
            # With this end closed, the death of the process is the end of the pipe.
            self._theirs.close()

    def interrupt(self) -> None:
        """Ask the process to end, if it has started; `end` waits for it."""
        if self.process.pid is not None:
            self.process.terminate()

    def ask(self, message: bytes) -> None:
        """Send a task; if the process has ended already, `answer` will say so."""
        try:
            self.connection.send_bytes(message)
        except OSError:
            return

    def answer(self) -> bytes | None:
        """Wait for the answer and return it; None if the process has ended instead."""
        try:
            return self.connection.recv_bytes()
        except (EOFError, OSError):
            self.end()
            return None

    def how_it_ended(self) -> str:
        """Return the exit code of the ended process in words."""
        code = self.process.exitcode or 0
        return f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"

    def end(self) -> None:
        """Wait for the process, which is about to end, and close the pipe."""
        if self.process.pid is not None:
            self.process.join(_GRACE_S)
            if self.process.exitcode is None:
                self.process.kill()
                self.process.join()
        self.connection.close()


def _answered(workers: Sequence[_Worker]) -> list[_Worker]:
    """Return those of the workers that have answered or ended, at least one, in their order."""
    ready = wait([worker.connection for worker in workers])
    return [worker for worker in workers if worker.connection in ready]


def _serve(connection: Connection) -> None:
    """Answer tasks until the asking process closes the pipe or ends."""
    signal.signal(signal.SIGTERM, _leave)
    try:
        while True:
            connection.send_bytes(answer(connection.recv_bytes()))
    except (EOFError, OSError):
        return


def _leave(_signal: int, _frame: FrameType | None) -> Any:
    # An exit, unlike the default, lets `with` blocks remove their temporary folders.
    sys.exit(1)


@contextmanager
def environment_of_workers() -> Iterator[None]:
    """Let a process that starts now have one thread for linear algebra, and leave Ctrl-C to its parent.

    An interrupt that arrives meanwhile is not lost: it is raised at the end of the block.
    """
    # Where it does not run yet, its start would end with Ctrl-C allowed again.
    resource_tracker.ensure_running()
    before = {name: os.environ.get(name) for name in _THREADS}
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
