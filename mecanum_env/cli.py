"""What every command line program shares: arguments from a function's signature, errors and exit codes."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

import tyro

from mecanum_env.errors import InputError, MecanumError
from mecanum_env.samples import with_samples


def run(command: Callable[..., Any], args: Sequence[str] | None = None, prog: str | None = None) -> int:
    """Call a command with parsed arguments and return the exit code of the program.

    Args:
        command: its signature gives the options, its docstring the help.
        args: the arguments; those of the running program when None. ``@examples/logs`` is a packaged folder.
        prog: name of the program in the help; that of the running one when None.

    Returns:
        The integer that the command returned, such as 1 for a failed certificate, or 0 if it returned
        anything else; 2 if it raised a `MecanumError`, whose message goes to stderr; 130 if it was
        interrupted. For wrong arguments tyro prints what is known and raises ``SystemExit(2)``.
    """
    try:
        args = with_samples(sys.argv[1:] if args is None else args)
        _require_no_empty(args)
        result = tyro.cli(command, args=args, prog=prog)
    except MecanumError as error:
        # Notes say in which of many tasks it was.
        print("\n  ".join([f"error: {error}", *getattr(error, "__notes__", ())]), file=sys.stderr)
        return 2
    except BrokenPipeError:
        # The reader (`| head`) has closed the pipe; without this the interpreter fails again when it flushes.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        print("interrupted; nothing half-written was left behind", file=sys.stderr)
        return 130
    return result if isinstance(result, int) else 0


def _require_no_empty(args: Sequence[str]) -> None:
    """Refuse empty arguments, as unset shell variables give: an empty path would mean the current folder."""
    for before, word in zip(("", *args), args, strict=False):
        option = before if before.startswith("--") else "an argument"
        if word.startswith("--") and word.endswith("=") and word.count("=") == 1:
            option, word = word[:-1], ""
        if not word:
            raise InputError(f"{option} is empty; give a value, or leave it out")
