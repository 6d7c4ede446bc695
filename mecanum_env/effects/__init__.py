"""The catalogue of effects: named departures from the ideal robot, one definition each.

`CATALOGUE` lists them in the order of the chain from command to log. This package imports no physics:
`mecanum_env.effects.apply` puts effects into a simulation.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from mecanum_env.effects import body, command, drive, floor, geometry, joint, sensor
from mecanum_env.effects.definition import PLANTS, Effect, Parameter, PlantKind

_CHAIN: Final = (
    *(command.COMMAND_LATENCY, command.BODY_SPEED_LIMIT, command.BODY_ACCELERATION_LIMIT),
    command.COMMAND_DEADBAND,
    *(drive.SPEED_GAIN, drive.WHEEL_GAIN_MISMATCH, drive.DIRECTION_ASYMMETRY, drive.BATTERY_SAG),
    *(drive.SPEED_SATURATION, drive.ACCELERATION_LIMIT),
    *(drive.WEAK_SERVO, joint.BACKLASH),
    *(joint.COULOMB_FRICTION, joint.STICTION, joint.VISCOUS_FRICTION),
    *(floor.ROLLER_FRICTION, floor.LOW_GRIP),
    *(body.PAYLOAD, body.COM_OFFSET),
    *(geometry.WHEEL_RADIUS, geometry.TRACK_WIDTH, floor.FLOOR_SLOPE),
    geometry.MOUNT_YAW,
    *(sensor.SENSOR_LATENCY, sensor.SENSOR_LOWPASS, sensor.SENSOR_SCALE, sensor.SENSOR_BIAS),
)

CATALOGUE: Final[Mapping[str, Effect]] = MappingProxyType({effect.name: effect for effect in _CHAIN})
"""Name -> effect, in the order of the chain."""

EFFECT_PARAMETERS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {name: tuple(p.name for p in effect.parameters) for name, effect in CATALOGUE.items()}
)
"""Names a model file may use under "effects", with their parameters."""

__all__ = ["CATALOGUE", "EFFECT_PARAMETERS", "PLANTS", "Effect", "Parameter", "PlantKind"]
