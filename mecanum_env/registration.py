"""Telling Gymnasium about the environments, as soon as Gymnasium is there.

This package is imported while ``import mujoco`` loads the wheel plugin, so it must not import Gymnasium
itself, and it may be imported before Gymnasium or after. Before, an import hook waits for Gymnasium.
`gymnasium.make("mecanum_env:MecanumTankendo-v0")` imports this package by itself.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Final

ENVIRONMENTS: Final = {
    "MecanumTankendo-v0": "dodge",
    "MecanumTankendoDodge-v0": "dodge",
    "MecanumTankendoTrack-v0": "track",
    "MecanumTankendoDuel-v0": "duel",
}
"""Name of the environment -> its task."""


def _register_environments() -> None:
    """Register every environment; Gymnasium must be loaded."""
    from gymnasium.envs.registration import register, registry

    one, many = "mecanum_env.tankendo.env:TankendoEnv", "mecanum_env.tankendo.vector:TankendoVectorEnv"
    for name, task in ENVIRONMENTS.items():
        if name not in registry:
            register(name, entry_point=one, vector_entry_point=many, kwargs={"task": task})


def register_when_gymnasium_is_there() -> None:
    """Register now if Gymnasium is loaded, else as soon as its last module, `gymnasium.envs`, is."""
    if "gymnasium.envs" in sys.modules:
        _register_environments()
    else:
        sys.meta_path.insert(0, _GymnasiumHook())


class _GymnasiumHook:
    """Import hook that finds nothing itself; it makes the loader of `gymnasium.envs` register when done.

    A finder by its method alone: importing `importlib.abc` would cost every `import mujoco` 20 ms.
    """

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name != "gymnasium.envs":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        if spec is None or spec.loader is None:
            return spec
        load = spec.loader.exec_module

        def load_and_register(module: ModuleType) -> None:
            load(module)
            _register_environments()

        # Only this one loader is changed, after it was found and before it runs; typed classes forbid it.
        spec.loader.exec_module = load_and_register  # type: ignore[method-assign]
        return spec
