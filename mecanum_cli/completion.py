"""Completion of `mecanum` in shells."""

from __future__ import annotations

import contextlib
import functools
import operator
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal

import tyro

from mecanum_cli.table import COMMANDS, load
from mecanum_env.programs import Done


def completion(shell: tyro.conf.Positional[Literal["bash", "zsh"]], /) -> Done:
    """Print the script that completes commands and options in a shell.

    Example: mecanum completion bash > ~/.local/share/bash-completion/completions/mecanum

    Args:
        shell: bash, or zsh (into a file named _mecanum of a folder in $fpath).

    Returns:
        The exit code.
    """
    loaded = {name: load(name) for name in COMMANDS}
    commands = {name: _group(one) if isinstance(one, Mapping) else one for name, one in loaded.items()}
    with contextlib.suppress(SystemExit):
        tyro.cli(
            _one_of(commands),
            prog="mecanum",
            args=["--tyro-print-completion", shell],
            config=(tyro.conf.OmitSubcommandPrefixes,),
        )
    return Done()


def _one_of(commands: Mapping[str, Callable[..., Any]]) -> Any:
    parts = [
        Annotated[Any, tyro.conf.subcommand(name=name, constructor=one)] for name, one in commands.items()
    ]
    return functools.reduce(operator.or_, parts)


def _group(commands: Mapping[str, Callable[..., Any]]) -> Callable[..., Any]:
    def group(command: Any) -> Any:
        return command

    group.__annotations__["command"] = _one_of(commands)
    return group
