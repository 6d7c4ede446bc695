"""The effects: named departures from the ideal robot, one definition each.

`mecanum_env.effects.apply` puts a model's effects into a simulation; `register` adds an effect of one's own.
"""

from mecanum_env.effects.catalogue import CATALOGUE, catalogue_json, catalogue_table, register, registered
from mecanum_env.effects.definition import PLANTS, Effect, Load, Parameter, PlantKind

__all__ = [
    "CATALOGUE",
    "PLANTS",
    "Effect",
    "Load",
    "Parameter",
    "PlantKind",
    "catalogue_json",
    "catalogue_table",
    "register",
    "registered",
]
