"""The robots of `--randomize levels`: what a policy should still win with when the model is not the robot."""

from __future__ import annotations

from mecanum_env.model import Model
from training.certify.plants import EXTRA_LATENCY_S, robot_level


def level_models(model: Model) -> dict[str, Model]:
    """Return the robots by name: the model, late, with the paper's losses, and in between.

    Args:
        model: what they are made from.
    """
    own = model.effects.get("command_latency", {}).get("delay_s", 0.0)
    slow = robot_level(model)
    half = model.with_effect(
        "speed_saturation", limit_rpm=0.85 * model.wheel.saturation_rpm, softness_rpm=40.0
    )

    def late(base: Model, delay_s: float) -> Model:
        return base.with_effect("command_latency", delay_s=own + delay_s)

    return {
        "nominal": model,
        "late": late(model, EXTRA_LATENCY_S),
        "little late": late(model, 0.5 * EXTRA_LATENCY_S),
        "robot-level": slow,
        "robot-level, little late": late(slow, 0.5 * EXTRA_LATENCY_S),
        "half way": half,
        "half way, late": late(half, EXTRA_LATENCY_S),
    }
