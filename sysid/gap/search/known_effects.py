"""Which effects a search tries on logs, and which of them a user means by a name."""

from __future__ import annotations

from collections.abc import Collection

from mecanum_env.effects import CATALOGUE, PlantKind
from mecanum_env.model import cause_of
from sysid.logs import Dataset
from sysid.logs.runs import Level


def known_effects(
    level: Level,
    plant: PlantKind = "rollers",
    columns: Collection[str] | None = None,
    *,
    command_falls: bool = True,
) -> tuple[str, ...]:
    """Return the effects that a search tries on logs of a level, in the order of the chain.

    `plant` simulates robot logs. `columns` are those that the logs have, by default all; `command_falls` says
    whether a command falls or reverses within any run of theirs.
    """
    used: PlantKind = "bench" if level == "bench" else plant
    return tuple(
        name
        for name, effect in CATALOGUE.items()
        if effect.searched_in(used)
        and (columns is None or effect.readable_in(columns))
        and not (level == "bench" and effect.needs_falling_command and not command_falls)
    )


def effects_for(dataset: Dataset, plant: PlantKind) -> tuple[str, ...]:
    """Return the effects that a search tries on the logs of a dataset; `plant` simulates robot logs."""
    return known_effects(dataset.level, plant, dataset.columns, command_falls=dataset.command_falls)


def is_meant(effect: str, names: Collection[str]) -> bool:
    """Return whether `names` of effects, or of causes with all their forms, mean an effect."""
    return effect in names or cause_of(effect) in names
