"""A task, what a worker does with it, and what becomes of its errors."""

from __future__ import annotations

import pickle
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Generic, Protocol, TypeVar

from mecanum_env.errors import MachineError, MecanumError
from mecanum_env.parallel.same_code import require_same_code

MOST_TRIES: Final = 3
"""How often a task is begun at most, if its worker ends without an answer."""
GUARD: Final = 'begin its work under `if __name__ == "__main__":`'
"""What a script must do whose work runs in processes: each of them imports the script."""

T = TypeVar("T")
Tell = Callable[[int, T], object]
"""Called in the asking process with the index of a finished task and its result, as results come."""


class WorkerLostError(MachineError):
    """A task whose worker process ended each time that it was begun."""


@dataclass(frozen=True)
class Task(Generic[T]):
    """One piece of work that depends on nothing but its arguments, which include its seed."""

    name: str
    """Stands beside its errors."""
    work: Callable[..., T]
    """A function of a module, or a method of an object that can be pickled."""
    arguments: tuple[Any, ...] = ()

    def __call__(self) -> T:
        """Do the work and return its result; an error gets a note with the name of the task."""
        try:
            return self.work(*self.arguments)
        except Exception as error:
            error.add_note(f"in the task {self.name}")
            raise


class Executor(Protocol):
    """Runs tasks somewhere."""

    def run(self, tasks: Sequence[Task[T]], tell: Tell[T] | None = None) -> list[T]:
        """Return the results in the order of the tasks.

        The first error that arrives stops the others.

        Args:
            tasks: each independent of the others.
            tell: called with every result as it comes.

        Raises:
            WorkerLostError: a task lost its worker process `MOST_TRIES` times.
        """
        ...


@dataclass(frozen=True)
class _Failure:
    """An error on its way back."""

    error: Exception


def packed(task: Task[Any], code: str) -> bytes:
    """Return a task for `answer` in another process, with the fingerprint of this process's code.

    Raises:
        TypeError: the task cannot be pickled.
    """
    try:
        return pickle.dumps((code, pickle.dumps(task)))
    except Exception as error:
        why = f"the task {task.name} cannot be sent to another process: {error}"
        raise TypeError(why) from error


def answer(message: bytes) -> bytes:
    """Do the work in the message of a `packed` task; return its result or error for `unpacked`."""
    try:
        code, task = pickle.loads(message)
        # Before the task is unpickled: other code may not even have its function.
        require_same_code(code)
        return pickle.dumps(pickle.loads(task)())
    except Exception as error:
        return _packed_error(error)


def unpacked(answered: bytes) -> Any:
    """Return the result in what `answer` returned (`answered`), or raise the error in it."""
    found = pickle.loads(answered)
    if isinstance(found, _Failure):
        raise found.error
    return found


def lost(name: str, how: str) -> WorkerLostError:
    """Return the error of the task with this name, whose worker ended `MOST_TRIES` times; `how` says why."""
    return WorkerLostError(
        f"the task {name} lost its worker process {MOST_TRIES} times ({how}): it crashes its process, or is "
        f"ended for its memory: try fewer --jobs; or a script does not {GUARD}"
    )


def _packed_error(error: Exception) -> bytes:
    # A traceback does not travel; errors on purpose say enough without it.
    if not isinstance(error, MecanumError):
        error.add_note("".join(traceback.format_exception(error)))
    try:
        message = pickle.dumps(_Failure(error))
        pickle.loads(message)
    except Exception:
        plain = RuntimeError(f"{type(error).__name__}: {error}")
        for note in getattr(error, "__notes__", ()):
            plain.add_note(note)
        message = pickle.dumps(_Failure(plain))
    return message
