"""What a drive does besides its law: effects that are added while the law is fitted again with them."""

from sysid.fit.effects.beam import searched
from sysid.fit.effects.ceiling import has_unasked_ceiling
from sysid.fit.effects.drive import DriveEffects, find_drive_effects
from sysid.fit.effects.reached import WORTH, HeldOut, Reached, confirmed
from sysid.fit.effects.search import EffectSearch
from sysid.fit.effects.uncertainty import with_uncertainty

__all__ = [
    "WORTH",
    "DriveEffects",
    "EffectSearch",
    "HeldOut",
    "Reached",
    "confirmed",
    "find_drive_effects",
    "has_unasked_ceiling",
    "searched",
    "with_uncertainty",
]
