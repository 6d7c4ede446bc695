"""Telling Gymnasium about the environments, as soon as Gymnasium is there.

This package is imported while ``import mujoco`` loads the wheel plugin, so it must not import Gymnasium
itself; and it may be imported before Gymnasium or after. Before, a finder waits for Gymnasium's import to
finish.
"""

from __future__ import annotations

import importlib.abc
import importlib.util
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Final

_ENTRY: Final = "mecanum_env.tankendo.env:TankendoEnv"
_VECTOR_ENTRY: Final = "mecanum_env.tankendo.vector:TankendoVectorEnv"
ENVIRONMENTS: Final = {
    "MecanumTankendo-v0": "dodge",
    "MecanumTankendoDodge-v0": "dodge",
    "MecanumTankendoTrack-v0": "track",
    "MecanumTankendoDuel-v0": "duel",
}
"""Name -> task."""


def register_environments() -> None:
    """Register every environment; Gymnasium must be loaded."""
    from gymnasium.envs.registration import register, registry

    for name, task in ENVIRONMENTS.items():
        if name not in registry:
            register(name, entry_point=_ENTRY, vector_entry_point=_VECTOR_ENTRY, kwargs={"task": task})


def register_when_gymnasium_is_there() -> None:
    """Register now if Gymnasium is loaded, else as soon as its last module, `gymnasium.envs`, is."""
    if "gymnasium.envs" in sys.modules:
        register_environments()
    else:
        sys.meta_path.insert(0, _Waiting())


class _Waiting(importlib.abc.MetaPathFinder):
    """Finds nothing; makes the loader of `gymnasium.envs` register when it is done."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the spec of `gymnasium.envs` (name), with a loader that registers afterwards."""
        if name != "gymnasium.envs":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        if spec is not None and spec.loader is not None:
            spec.loader = _ThenRegister(spec.loader)
        return spec


class _ThenRegister(importlib.abc.Loader):
    def __init__(self, loader: importlib.abc.Loader) -> None:
        self._loader = loader

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        return self._loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        self._loader.exec_module(module)
        register_environments()
