"""Package doors that import what they offer only when it is asked for (PEP 562).

A package lists its public names once, as ordinary imports for type checkers, and leaves them to this module
at run time:

    if TYPE_CHECKING:
        from mecanum_env.model import Model, read_model
    else:
        __getattr__, __dir__ = lazy_exports(__name__, __file__)

    __all__ = ["Model", "read_model"]
"""

from __future__ import annotations

import ast
import importlib
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any


def lazy_exports(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return the `__getattr__` and `__dir__` of a package whose public names are imported on first use.

    Args:
        package: the package's `__name__`.
        file: its `__file__`, whose `if TYPE_CHECKING:` block says which module each name comes from.
    """

    def load(name: str) -> Any:
        # Private names are never exported, and Python asks every package for some of them.
        source = None if name.startswith("_") else exported_names(file).get(name)
        if source is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name, obj=None)
        module, original = source
        value = getattr(importlib.import_module(module), original)
        setattr(sys.modules[package], name, value)
        return value

    def names() -> list[str]:
        return sorted({*vars(sys.modules[package]), *exported_names(file)})

    return load, names


@cache
def exported_names(file: str) -> dict[str, tuple[str, str]]:
    """Return public name -> (module, name in it) of the `if TYPE_CHECKING:` block of a package's `file`."""
    tree = ast.parse(Path(file).read_text(encoding="utf-8"))
    return {
        alias.asname or alias.name: (str(node.module), alias.name)
        for block in tree.body
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
