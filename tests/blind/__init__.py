"""Blind tests: two simulators that share no code with the catalogue of effects, and what they hide.

What this package offers is `sysid.studies.blind.cases.BlindTests`.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

from sysid.studies.blind.cases import Case

from . import bench_cases, bench_logs
from .drive import DRIVES, Hidden
from .recipes import Recipe


def cases(seed: int) -> tuple[Case, ...]:
    """Return every case that a seed gives, bench first."""
    return tuple(recipe.case for recipe in _recipes(seed).values())


def write_nominal(plant: str, folder: Path) -> None:
    """Write effect-free logs of a plant to `folder`/logs and what is known of it to `folder`/robot.json."""
    folder.mkdir(parents=True, exist_ok=True)
    if plant in DRIVES:
        bench_logs.write_nominal(plant, folder)
        return
    from . import robot_logs

    robot_logs.write_nominal(plant, folder)


def write_case(name: str, seed: int, folder: Path) -> None:
    """Write the logs of a case to `folder`."""
    recipe = _recipes(seed)[name]
    plant, rng = recipe.case.plant, recipe.rng(seed)
    if recipe.case.level == "bench":
        hidden = replace(Hidden(), **recipe.hidden)
        bench_logs.write_case(plant, hidden, recipe.gentle, rng, folder)
        return
    from . import robot_logs

    robot_logs.write_case(recipe.hidden, recipe.gentle, rng, folder)


@cache
def _recipes(seed: int) -> dict[str, Recipe]:
    from . import robot_cases

    return {r.case.name: r for r in [*bench_cases.recipes(seed), *robot_cases.recipes(seed)]}
