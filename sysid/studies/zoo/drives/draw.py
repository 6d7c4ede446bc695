"""Drives drawn at random: a plant first, then a controller tuned to it as a user would, then its sensor."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from sysid.studies.zoo.drives.drive import Drive, Family
from sysid.studies.zoo.drives.families import FAMILIES
from sysid.studies.zoo.drives.plant import draw_battery, draw_link, draw_plant, draw_sensor, log_uniform
from sysid.studies.zoo.drives.trial import try_out
from sysid.studies.zoo.drives.tuning import draw_controller

_ATTEMPTS = 200


def family_of(seed: int) -> Family:
    """Return the family that a seed has where none is asked for."""
    names = sorted(FAMILIES)
    return names[int(np.random.default_rng((seed, 0)).integers(len(names)))]


def draw_drive(seed: int, family: Family | None = None) -> Drive:
    """Return the drive of a seed: always the same, and useful (`trial.Trial.useful`).

    `family` is its topology; without it the seed draws one.

    Raises:
        RuntimeError: No useful drive was found, which no seed is known to do.
    """
    return draw_with_attempts(seed, family)[0]


def draw_with_attempts(seed: int, family: Family | None = None) -> tuple[Drive, int]:
    """Return the drive of a seed and a family as `draw_drive` does, and how many were drawn until it."""
    family = family or family_of(seed)
    for attempt in range(_ATTEMPTS):
        drive = _candidate(np.random.default_rng((seed, 1 + attempt)), family)
        if try_out(drive).useful:
            return drive, attempt + 1
    raise RuntimeError(f"no useful drive of family {family} in {_ATTEMPTS} attempts with seed {seed}")


def _candidate(rng: np.random.Generator, family: Family) -> Drive:
    """Draw a drive that may be of no use."""
    plant = draw_plant(rng)
    controller = draw_controller(rng, family, plant)
    motor = plant.motor
    if controller.current_kp > 0.0 and math.isinf(motor.current_limit_a):
        # A current loop always has a limit.
        stall_a = motor.supply_v / motor.resistance_ohm
        motor = replace(motor, current_limit_a=log_uniform(rng, 0.35, 1.0) * stall_a)
    return Drive(
        motor=motor,
        gear=plant.gear,
        controller=controller,
        sensor=draw_sensor(rng, plant.top_rpm, controller.encoder_counts),
        link=draw_link(rng),
        battery=draw_battery(rng, motor.supply_v),
        top_rpm=plant.top_rpm,
    )
