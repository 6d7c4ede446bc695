"""Which ceilings logs show: those that commands go beyond, and at which the speed stays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.model import Model, cause_of
from mecanum_env.units import FloatArray
from sysid.compare.measured import Observations

_SPARE: Final = 0.05
"""Share by which a ceiling must lie above all commands, or below the largest. Assumed."""
_RISE: Final = 0.2
"""Share of the slope below a ceiling with which speeds may rise beyond it. Assumed."""
_HELD_S: Final = 0.5
"""Shortest time for which a command is held whose speed counts as reached [s]. Assumed."""


@dataclass(frozen=True, eq=False)
class HeldSpeeds:
    """How fast a wheel on the bench turned while a command was held."""

    command_rpm: FloatArray
    """Commands that were held, without their signs, shape (n,); none of a robot."""
    speed_rpm: FloatArray
    """Mean speed over the second half of the time, without its sign, shape (n,)."""

    @classmethod
    def of(cls, observations: Observations) -> HeldSpeeds:
        """Return those of some logs."""
        commands: list[float] = []
        speeds: list[float] = []
        for block in observations.blocks:
            run = observations.situations[block.situation].runs[0]
            if block.channel != "speed_rpm":
                continue
            command = run.command.wheels_rpm.reshape(run.time_s.size)
            changes = np.flatnonzero(np.diff(command)) + 1
            for first, end in zip([0, *changes], [*changes, command.size], strict=True):
                last_s = run.time_s[min(end, command.size - 1)]
                half_s = (last_s - run.time_s[first]) / 2.0
                rows = (block.time_s > last_s - half_s) & (block.time_s < last_s)
                if 2.0 * half_s >= _HELD_S and rows.any():
                    commands.append(abs(float(command[first])))
                    speeds.append(abs(float(np.mean(block.value[rows]))))
        return cls(np.array(commands), np.array(speeds))

    def rise_beyond_ceiling(self, model: Model) -> bool:
        """Return whether speeds still rise with commands beyond a ceiling of a model.

        Then it is a bend of the curve, soft or not, and how fast the motor may turn is not in the logs.
        """
        gain = _gain(model)
        for limit, _ in _ceilings(model):
            beyond = gain * self.command_rpm > limit
            command = self.command_rpm[beyond]
            if command.size < 2 or np.ptp(command) < _SPARE * np.max(command):
                continue
            slope = float(np.polyfit(command, self.speed_rpm[beyond], 1)[0])
            if slope > _RISE * gain:
                return True
        return False


def has_unasked_ceiling(model: Model, asked_rpm: float) -> bool:
    """Return whether a model's speed ends about where the commands of the logs do, at `asked_rpm`.

    Such a ceiling cuts off some overshoots in these logs, and every faster command in the next ones. Nor do
    logs show a soft one of which they reach the knee alone: where it ends is a guess.
    """
    asked = max(_gain(model) * asked_rpm, 1e-9)
    for limit, softness in _ceilings(model):
        if abs(limit / asked - 1.0) < _SPARE or limit - softness < asked < limit + softness:
            return True
    return False


def _gain(model: Model) -> float:
    return model.effects.get("speed_gain", {}).get("gain", 1.0)


def _ceilings(model: Model) -> list[tuple[float, float]]:
    """Return limit and softness [rpm] of each ceiling among a model's effects."""
    effects = [values for name, values in model.effects.items() if cause_of(name) == "speed_saturation"]
    return [(values["limit_rpm"], values.get("softness_rpm", 0.0)) for values in effects]
