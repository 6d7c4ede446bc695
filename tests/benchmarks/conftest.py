"""Benchmarks as modules: they are scripts in a folder of their own."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture(scope="module")
def benchmark_of() -> Iterator[Callable[[str], ModuleType]]:
    """Return what imports a benchmark by its name, found as when it is run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(Path(__file__).parents[2] / "benchmarks")
        yield importlib.import_module
