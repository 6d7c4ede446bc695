"""What can be fitted, as numbers from 0 to 1: sets of effects, the wheel law, and both together."""

from sysid.compare.search_space.candidate import Candidate
from sysid.compare.search_space.coordinates import (
    Bounds,
    Coordinate,
    EffectSet,
    components,
    coordinate,
    effect_set,
    excludes_itself,
    joined,
    scanned,
    searched_alone,
)
from sysid.compare.search_space.law import LawWithEffects, RefittedLaw, robot_deviations
from sysid.compare.search_space.scale import scale_of

__all__ = [
    "Bounds",
    "Candidate",
    "Coordinate",
    "EffectSet",
    "LawWithEffects",
    "RefittedLaw",
    "components",
    "coordinate",
    "effect_set",
    "excludes_itself",
    "joined",
    "robot_deviations",
    "scale_of",
    "scanned",
    "searched_alone",
]
