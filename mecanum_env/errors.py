"""The project's errors; each message says what is wrong, where, and what would be right.

Command line programs print the message alone and exit with code 2 (`mecanum_env.cli.run`).
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class MecanumError(Exception):
    """Base class of all errors that this project raises on purpose."""


class InputError(MecanumError, ValueError):
    """A file, value or argument from the user that cannot be used; the message says what could."""


class EffectRefusedError(InputError):
    """A model with an effect that the chosen plant cannot simulate."""


class UnstableLawError(InputError):
    """A wheel law with a pole on or outside the unit circle."""


class BackendError(MecanumError, RuntimeError):
    """A missing graphics library, plugin library or packaged file; the message says what to install."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return ``' (did you mean "x"?)'`` for the known name most like `name`, or ``''`` if none is like it."""
    # str(), since a name of a wrong type is to be refused with the caller's message.
    near = difflib.get_close_matches(str(name), list(known), n=1, cutoff=0.6)
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
