"""What every command line program shares: bad input is one sentence on stderr and exit code 2."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

import tyro

from mecanum_env.errors import InputError, MecanumError


def run(command: Callable[..., Any], args: Sequence[str] | None = None, prog: str | None = None) -> int:
    """Parse `args` for `command` (its signature and docstring are the help), call it, return the exit code.

    `prog` is the name of the program in the help; None takes that of the running one.

    Returns:
        What the command returned if that is a whole number, such as 1 for a test that was not passed; else 0
        when it returned, 2 when it raised a `MecanumError`, 130 when it was interrupted. Wrong
        arguments make tyro print what is known and raise ``SystemExit(2)``.
    """
    try:
        _require_no_empty(sys.argv[1:] if args is None else args)
        result = tyro.cli(command, args=args, prog=prog)
    except MecanumError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        # The reader (`| head`) has seen enough; keep the interpreter from failing again when it flushes.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        print("interrupted; nothing half-written was left behind", file=sys.stderr)
        return 130
    return result if isinstance(result, int) else 0


def _require_no_empty(args: Sequence[str]) -> None:
    """Refuse an empty argument, such as an unset variable's: as a path it would be the current folder."""
    for before, word in zip(("", *args), args, strict=False):
        option = before if before.startswith("--") else "an argument"
        if word.startswith("--") and word.endswith("=") and word.count("=") == 1:
            option, word = word[:-1], ""
        if not word:
            raise InputError(f"{option} is empty; give a value, or leave it out")
