"""Which ceilings logs show: those that commands go beyond."""

from __future__ import annotations

from typing import Final

from mecanum_env.model import Model, cause_of

_SPARE: Final = 0.05
"""Share by which a ceiling must lie above all commands, or below the largest. Assumed."""


def has_unasked_ceiling(model: Model, asked_rpm: float) -> bool:
    """Return whether a model's speed ends about where the commands of the logs do, at `asked_rpm`.

    Such a ceiling cuts off some overshoots in these logs, and every faster command in the next ones. Nor do
    logs show a soft one of which they reach the knee alone: where it ends is a guess.
    """
    asked = max(model.effects.get("speed_gain", {}).get("gain", 1.0) * asked_rpm, 1e-9)
    for name, values in model.effects.items():
        if cause_of(name) == "speed_saturation":
            limit = values["limit_rpm"]
            if abs(limit / asked - 1.0) < _SPARE or limit - values.get("softness_rpm", 0.0) < asked < limit:
                return True
    return False
