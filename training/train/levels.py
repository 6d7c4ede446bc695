"""The robots of `--randomize levels`: what a policy should still win with when the model is not the robot."""

from __future__ import annotations

from typing import Final

from mecanum_env.model import Model
from mecanum_env.tankendo.actions import FULL_V_RPM
from training.certify.plants import EXTRA_LATENCY_S, robot_level

HALF_LATENCY_S: Final = EXTRA_LATENCY_S / 2
"""A delay between none and that of a certificate [s]."""
HALF_CEILING: Final = 0.85
"""Ceiling of the robot between the model and the paper's, over the model's; soft over 40 rpm. Ours."""


def level_models(model: Model) -> dict[str, Model]:
    """Return the robots by name: the model itself, late, with the paper's losses, and in between.

    Args:
        model: what they are made from.
    """
    own = model.effects.get("command_latency", {}).get("delay_s", 0.0)
    ceiling = HALF_CEILING * min(model.wheel.saturation_rpm, FULL_V_RPM)
    return {
        "nominal": model,
        "a little late": model.with_effect("command_latency", delay_s=own + HALF_LATENCY_S),
        "late": model.with_effect("command_latency", delay_s=own + EXTRA_LATENCY_S),
        "a little slow": model.with_effect("speed_saturation", limit_rpm=ceiling, softness_rpm=40.0),
        "robot-level": robot_level(model),
    }
