"""The project's errors; each message says what is wrong, where, and what would be right.

Command line programs print the message alone and exit with the code of the error's class
(`mecanum_env.cli.run`).
"""

from __future__ import annotations

import difflib
import errno
import os
from collections.abc import Iterable
from typing import ClassVar, Final


class MecanumError(Exception):
    """Base class of all errors that this project raises on purpose."""

    exit_code: ClassVar[int] = 2
    """What a command line program ends with: 2 where other input would help, 3 where the machine failed."""


class InputError(MecanumError, ValueError):
    """A file, value or argument from the user that cannot be used; the message says what could."""


class EffectRefusedError(InputError):
    """A model with an effect that the chosen plant cannot simulate."""


class UnstableLawError(InputError):
    """A wheel law with a pole on or outside the unit circle."""


class MachineError(MecanumError, RuntimeError):
    """The machine could not finish the work: a full disk, no memory, a worker that died."""

    exit_code = 3


class BackendError(MecanumError, RuntimeError):
    """A missing graphics library, plugin library or packaged file; the message says what to install."""


_MACHINE: Final = frozenset(
    (
        errno.ENOSPC,
        errno.EDQUOT,
        errno.EFBIG,
        errno.EIO,
        errno.ENOMEM,
        errno.EMFILE,
        errno.ENFILE,
        errno.EROFS,
    )
)
"""Errors of the operating system that no other input mends."""
_LONGEST_NAME: Final = 100
"""Names beyond this length are not compared with others, which takes the square of it."""


def is_machine_error(error: BaseException) -> bool:
    """Return whether an `error` says that the machine failed: memory, disk, open files."""
    return isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno in _MACHINE)


def write_error(
    target: str | os.PathLike[str], error: OSError, advice: str = "choose another folder"
) -> MecanumError:
    """Return what to raise when a target could not be written because of an `error`.

    That is a `MachineError` for a full or broken disk, else an `InputError` with the `advice`.
    """
    if is_machine_error(error):
        return MachineError(f"{target}: not written ({error.strerror}); make room, or choose another folder")
    return InputError(f"{target}: cannot be written ({error.strerror or error}); {advice}")


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return ``' (did you mean "x"?)'`` for the known name most like `name`, or ``''`` if none is like it."""
    # str(), since a name of a wrong type is to be refused with the caller's message.
    name = str(name)
    if len(name) > _LONGEST_NAME:
        return ""
    near = difflib.get_close_matches(
        name, [one for one in known if len(one) <= _LONGEST_NAME], n=1, cutoff=0.6
    )
    return f' (did you mean "{near[0]}"?)' if near else ""


def require_one_of(name: str, value: object, known: Iterable[str]) -> None:
    """Refuse a value, of the argument `name`, that is not one of the known ones.

    Raises:
        InputError: it is none of them; the message lists them.
    """
    choices = tuple(known)
    if value not in choices:
        raise InputError(
            f"{name} = {value!r}{did_you_mean(str(value), choices)}, must be {', '.join(choices)}"
        )


def require_at_least(least: int, **values: int) -> None:
    """Refuse values, by the names that the user knows, that are too small.

    Raises:
        InputError: a number is below `least`.
    """
    for name, value in values.items():
        if value < least:
            raise InputError(f"{name} = {value}, must be at least {least}")


def install_command(extra: str) -> str:
    """Return the command that installs an `extra` of this package: of the checkout, or what was installed."""
    from mecanum_env.checkout import checkout

    in_checkout = f'`pip install -c constraints.txt ".[{extra}]"` in the checkout'
    return in_checkout if checkout() else f'`pip install "mecanum-tankendo[{extra}]"`'
