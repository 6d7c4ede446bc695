"""One family of errors: each message says what was wrong, where, and what would be right.

Command line programs print the message alone and exit with code 2 (`mecanum_env.cli.run`).
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class MecanumError(Exception):
    """Base of every error this project raises on purpose."""


class InputError(MecanumError, ValueError):
    """A file, value or argument that a user gave is not usable; the message says what would be."""


class EffectRefusedError(InputError):
    """A model with an effect that the chosen way of simulating it cannot express."""


class UnstableLawError(InputError):
    """A wheel law with a pole on or outside the unit circle."""


class BackendError(MecanumError, RuntimeError):
    """A missing system part (graphics library, plugin binary); the message names what to install."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return ``' (did you mean "x"?)'`` for the nearest known name, or ``''`` when none is near."""
    # An argument of the wrong type gets the caller's sentence too.
    near = difflib.get_close_matches(str(name), list(known), n=1, cutoff=0.6)
    return f' (did you mean "{near[0]}"?)' if near else ""


def require_at_least(least: int, **values: int) -> None:
    """Refuse numbers that are too small.

    Args:
        least: the smallest that is right.
        **values: the numbers by the name that the user knows.

    Raises:
        InputError: one of them is below `least`.
    """
    for name, value in values.items():
        if value < least:
            raise InputError(f"{name} = {value}, must be at least {least}")


def install_command(extra: str) -> str:
    """Return the command that installs what an `extra` of the package needs; no package index has it."""
    return f'`pip install -c constraints.txt ".[{extra}]"` in the checkout'
