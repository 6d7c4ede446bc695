"""The commands of `mecanum`, found without importing them."""

from __future__ import annotations

import ast
import importlib
import importlib.util
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, TypeAlias

from mecanum_env.programs import summary

Program: TypeAlias = Callable[..., Any]

COMMANDS: Final[Mapping[str, str]] = {
    "demo": "mecanum_cli.demo:demo",
    "doctor": "mecanum_cli.doctor:doctor",
    "logs": "sysid.logs.__main__:COMMANDS",
    "fit": "sysid.fit.__main__:fit",
    "gap": "sysid.gap.__main__:gap",
    "simulate": "sysid.simulate:simulate",
    "online": "sysid.online.__main__:main",
    "mjcf": "mecanum_env.mjcf.__main__:main",
    "render": "mecanum_env.render:render",
    "view": "mecanum_env.view.__main__:view",
    "effects": "mecanum_env.effects.__main__:main",
    "train": "training.train.__main__:main",
    "certify": "training.certify.__main__:main",
    "compare": "training.compare.__main__:main",
    "record": "training.record.__main__:main",
    "export": "training.export.__main__:export",
    "run": "training.run.__main__:drive",
    "simulated-robot": "training.run.simulated_robot:simulated_robot",
    "reproduce": "sysid.studies.reproduce.__main__:main",
    "gapbench": "sysid.studies.gapbench.__main__:COMMANDS",
    "completion": "mecanum_cli.completion:completion",
}
"""Name of a command -> module and name of its function, or of a table of functions by the second word."""


def load(name: str) -> Program | Mapping[str, Program]:
    """Import and return the function, or the table of functions, of a command by its `name`."""
    module, attribute = COMMANDS[name].split(":")
    found: Program | Mapping[str, Program] = getattr(importlib.import_module(module), attribute)
    return found


def overview() -> str:
    """Return the list of all commands with what each does, from their source: none is imported."""
    width = max(map(len, COMMANDS)) + 2
    return "\n".join(f"  {name:{width}}{_summary(name)}" for name in COMMANDS)


def _summary(name: str) -> str:
    """Return the first line of the docstring of a command's function, or of its module for a table."""
    module, attribute = COMMANDS[name].split(":")
    package, *rest = module.split(".")
    # Only the top package is looked up: finding a module inside imports what is around it.
    spec = importlib.util.find_spec(package)
    assert spec is not None
    assert spec.origin is not None
    path = Path(spec.origin).parent.joinpath(*rest).with_suffix(".py")
    tree = ast.parse(path.read_text(encoding="utf-8"))
    functions = [n for n in tree.body if isinstance(n, ast.FunctionDef) and n.name == attribute]
    return summary(ast.get_docstring(functions[0] if functions else tree))
