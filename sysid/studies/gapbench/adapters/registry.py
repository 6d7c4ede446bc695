"""The methods of the leaderboard by name, loaded when they are used: some need a package of their own."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, cast

from mecanum_env.errors import install_command
from sysid.studies.gapbench.cases import Answer, BenchCase

Method = Callable[[BenchCase], Answer]


@dataclass(frozen=True)
class Adapter:
    """One method."""

    words: str
    """What it does, in a sentence."""
    needs: tuple[str, ...] = ()
    """Modules that must be installed."""

    def missing(self) -> str:
        """Return which module is missing, and how to install it; empty if none is."""
        for module in self.needs:
            if importlib.util.find_spec(module) is None:
                return f"needs {module}: {install_command('gapbench')}"
        return ""


ADAPTERS: Final[Mapping[str, Adapter]] = MappingProxyType(
    {
        "ours": Adapter("The study of `sysid.gap` on the simulator that `sysid.fit` gave."),
        "always_no_gap": Adapter("Says no gap, always."),
        "most_frequent_name": Adapter(
            "Says no gap where the error is that of the nominal logs, else names acceleration_limit."
        ),
        "friction_bic": Adapter(
            "Nested friction models on the fitted law, chosen by the Bayesian information criterion (as BAM)."
        ),
        "sindy": Adapter("PySINDy on the simulator's error, and a table from terms to names.", ("pysindy",)),
        "cmaes_all": Adapter(
            "CMA-ES over all effects at once; the largest significant one is named (as PACE).", ("cma",)
        ),
        "mujoco_sysid": Adapter(
            "mujoco.sysid with all parameters of a wheel free; the largest significant change is named.",
            ("absl", "colorama", "tabulate", "yaml"),
        ),
    }
)
"""Name, which is also that of its module -> method."""


def load(name: str) -> Method:
    """Return the function `answer` of the method of a name in `ADAPTERS`."""
    module = importlib.import_module(f"sysid.studies.gapbench.adapters.{name}")
    return cast(Method, module.answer)
