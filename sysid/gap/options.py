"""Checks of what a user asks of a study."""

from __future__ import annotations

from mecanum_env.effects import CATALOGUE, Plant
from mecanum_env.errors import InputError, did_you_mean
from sysid.gap.records import GapOptions
from sysid.logs.records import Level


def require_valid(options: GapOptions, level: Level) -> None:
    """Refuse options that make no sense for the logs.

    Args:
        options: as given.
        level: what the logs are.

    Raises:
        InputError: another level than that of the logs, a count below 1, no time to decide on, or an effect
            that does not exist, has nothing to act on at this level, or is both asked for and excluded.
    """
    if options.level not in ("auto", level):
        raise InputError(f"level {options.level}: these are {level} logs; leave it out, or give {level}")
    if options.plant == "planar" and level == "bench":
        raise InputError("plant planar: these are bench logs, which have no robot; leave it out")
    known = known_effects(level, options.plant)
    for option, names in (("only", options.only), ("exclude", options.exclude)):
        for name in names:
            if name not in CATALOGUE:
                raise InputError(
                    f"{option} {name}: no such effect{did_you_mean(name, CATALOGUE)}; "
                    f"for {level} logs: {', '.join(known)}"
                )
    for name in options.only:
        if name not in known:
            raise InputError(f"only {name}: does nothing in {level} logs; there: {', '.join(known)}")
        if name in options.exclude:
            raise InputError(f"only {name}: excluded as well; leave out one of the two")
    if not set(known) - set(options.exclude):
        raise InputError(f"exclude: no effect is left to look for; for {level} logs: {', '.join(known)}")
    for option, count in (("max-effects", options.max_effects), ("jobs", options.jobs)):
        if count < 1:
            raise InputError(f"{option} = {count}, must be at least 1")
    if options.seconds is not None and not options.seconds > 0.0:
        raise InputError(f"seconds = {options.seconds:g}, must be above 0")
    if options.seed < 0:
        raise InputError(f"seed = {options.seed}, must be 0 or more")


def known_effects(level: Level, plant: Plant = "rollers") -> tuple[str, ...]:
    """Return the effects that act on logs of a level, in the order of the chain.

    Args:
        level: of the logs.
        plant: that a robot is simulated with.
    """
    used: Plant = "bench" if level == "bench" else plant
    return tuple(name for name, effect in CATALOGUE.items() if effect.acts_in(used))
