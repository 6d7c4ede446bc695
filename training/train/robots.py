"""The robots of a training: a few side by side, or many that are drawn."""

from __future__ import annotations

from typing import Final

import numpy as np

from mecanum_env.effects.apply import delayed
from mecanum_env.model import Model
from mecanum_env.tankendo.actions import FULL_V_RPM
from mecanum_env.tankendo.randomize import Pool, Sampler, sampler_for
from training.certify.plants import EXTRA_LATENCY_S, knows_uncertainty, robot_level

_HALF_LATENCY_S: Final = EXTRA_LATENCY_S / 2
"""Extra latency of the robot "a little late" [s]: half of that in a certificate."""
_REDUCED_SPEED: Final = 0.85
"""Maximum wheel speed of the robot "a little slow", relative to the model's; this project's choice."""
_UNCHANGED: Final = 0.25
"""Share of the drawn robots that are the model, or drawn from its uncertainty alone."""
_CEILING: Final = (0.7, 1.0)
"""Ends of a drawn speed limit, relative to the model's: from that of the paper's robot on."""
_SOFTNESS_RPM: Final = (0.0, 75.0)
_FRICTION_RAD_S: Final = (0.0, 0.2)
"""Ends of drawn Coulomb friction, relative to the servo's gain; the paper's robot has 0.153."""
_TRACK: Final = (0.87, 1.05)
"""Ends of a drawn scale of the track width; the paper's robot has 0.887."""
_OFTEN, _SELDOM = 0.5, 0.3


def level_models(model: Model) -> dict[str, Model]:
    """Return the robots of `--randomize levels` by name.

    They are the model itself, with latency, with the losses that the paper measured, and in between.
    """
    return {
        "nominal": model,
        "a little late": delayed(model, _HALF_LATENCY_S),
        "late": delayed(model, EXTRA_LATENCY_S),
        "a little slow": model.with_effect(
            "speed_saturation", limit_rpm=_REDUCED_SPEED * _limit_rpm(model), softness_rpm=40.0
        ),
        "robot-level": robot_level(model),
    }


def varied_models(
    model: Model, latency_s: tuple[float, float], count: int, rng: np.random.Generator
) -> tuple[Model, ...]:
    """Return the robots of `--randomize varied`: `count` of them, drawn with the generator `rng`.

    Each is drawn from the uncertainty of the identification, the intervals of the gap workflow's effects
    included, if the model holds one. A quarter of them stay so. Of the others every one is late by a latency
    from the range [s], half have a lower and softer speed limit, and some have friction or turn by less.
    """
    known: Sampler | Pool | None = sampler_for("posterior", model) if knows_uncertainty(model) else None
    drawn = []
    for _ in range(count):
        robot = model if known is None else known.draw(rng)
        drawn.append(robot if rng.random() < _UNCHANGED else _changed(robot, latency_s, rng))
    return tuple(drawn)


def _changed(model: Model, latency_s: tuple[float, float], rng: np.random.Generator) -> Model:
    robot = delayed(model, rng.uniform(*latency_s))
    if rng.random() < _OFTEN:
        limit = rng.uniform(*_CEILING) * _limit_rpm(model)
        softness = min(rng.uniform(*_SOFTNESS_RPM), limit)
        robot = robot.with_effect("speed_saturation", limit_rpm=limit, softness_rpm=softness)
    if rng.random() < _SELDOM:
        torque = rng.uniform(*_FRICTION_RAD_S) * model.robot.servo_n_m_s_rad
        robot = robot.with_effect("coulomb_friction", torque_n_m=torque)
    if rng.random() < _SELDOM:
        robot = robot.with_effect("track_width", scale=rng.uniform(*_TRACK))
    return robot


def _limit_rpm(model: Model) -> float:
    return min(model.wheel.saturation_rpm, FULL_V_RPM)
