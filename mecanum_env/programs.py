"""What programs of several commands share, and what a program says to machines when it is done."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from mecanum_env.cli import run


class Done(int):
    """Exit code of a program, with what it wrote and found; `mecanum COMMAND --json` prints those."""

    wrote: tuple[Path, ...]
    """Files, in the order of their importance."""
    found: Any
    """What the program found, in JSON's types; None if it is in one of the files."""
    error: str | None
    """What went wrong, where that is no exception."""

    def __new__(
        cls, code: int = 0, *, wrote: Sequence[Path] = (), found: Any = None, error: str | None = None
    ) -> Self:
        """Return the exit code with what was written and found."""
        done = super().__new__(cls, code)
        done.wrote, done.found, done.error = tuple(wrote), found, error
        return done


def run_one_of(
    commands: Mapping[str, Callable[..., Any]],
    args: Sequence[str],
    prog: str,
    run: Callable[[Callable[..., Any], Sequence[str], str], int] = run,
) -> int:
    """Run the one of `commands` that the first of `args` names; return the exit code.

    `prog` is the name of the program in its help. Without a known name the commands are listed: on stdout for
    --help, else on stderr with exit code 2. `run` runs the command, with its arguments and its name.
    """
    if args and args[0] in commands:
        return run(commands[args[0]], args[1:], f"{prog} {args[0]}")
    help_wanted = list(args[:1]) in (["-h"], ["--help"])
    width = max(map(len, commands)) + 2
    lines = "\n".join(f"  {name:{width}}{summary(command.__doc__)}" for name, command in commands.items())
    usage = f"usage: {prog} {{{','.join(commands)}}} ...\n\n{lines}"
    print(usage, file=sys.stdout if help_wanted else sys.stderr)
    return 0 if help_wanted else 2


def summary(docstring: str | None) -> str:
    """Return the first line of a docstring."""
    return (docstring or "").strip().split("\n")[0]
