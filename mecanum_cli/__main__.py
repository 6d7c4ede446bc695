"""`mecanum COMMAND ...`, also `python -m mecanum_cli`: all programs under one name."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import Final

from mecanum_cli.machine import run_for_machines
from mecanum_cli.table import COMMANDS, load, overview
from mecanum_env.cli import run
from mecanum_env.errors import did_you_mean
from mecanum_env.programs import run_one_of
from mecanum_env.version import __version__

JSON: Final = "--json"
_USAGE: Final = """usage: mecanum COMMAND ... [--json]

A Mecanum robot in MuJoCo whose wheels behave as measured. Begin with: mecanum demo

{commands}

mecanum COMMAND --help says more. With --json, a command writes one JSON object to stdout: its exit code, its
error, the files that it wrote, what is in those of them that are JSON, and what it would print.
Exit codes: 0 done, 1 certificate not passed, 2 wrong input, 3 this machine lacks or failed something.
"""


def main(args: Sequence[str] | None = None) -> int:
    """Run the command that `args`, by default the program's arguments, name; return its exit code."""
    words = list(sys.argv[1:] if args is None else args)
    as_json = JSON in words
    words = [word for word in words if word != JSON]
    if words[:1] in (["-h"], ["--help"]):
        print(_USAGE.format(commands=overview()), end="")
        return 0
    if words[:1] == ["--version"]:
        print(f"mecanum-tankendo {__version__}")
        return 0
    if not words:
        print(_USAGE.format(commands=overview()), end="", file=sys.stderr)
        return 2
    name, rest = words[0], words[1:]
    if name not in COMMANDS:
        hint = did_you_mean(name, COMMANDS)
        print(f"error: no command {name!r}{hint}; `mecanum --help` lists all", file=sys.stderr)
        return 2
    command, runner = load(name), run_for_machines if as_json else run
    if isinstance(command, Mapping):
        return run_one_of(command, rest, f"mecanum {name}", runner)
    return runner(command, rest, f"mecanum {name}")


if __name__ == "__main__":
    sys.exit(main())
