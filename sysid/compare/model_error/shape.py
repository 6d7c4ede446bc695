"""Columns for the shape of a model's own error: smooth functions of the commands and of the predicted speed.

A law with its effects errs in ways that repeat: after a change of command by a function of the time since and
of the size of the change, different for speeding up and slowing down; while a command is held by a function
of the speed; near a reversal by its sign; and while the wheel is far behind its command by how far it is.
Each of these is a sum of columns with unknown factors. Times are in units of the law's response time, speeds
in units of the largest one, so that one basis serves a wheel of any speed. A displacement spans a window,
over which its columns are averaged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.kinematics import wheels_to_body
from mecanum_env.law import LawState
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.measured import WINDOW_S, Block, Observations, Situation, changes_from_rest
from sysid.compare.model_error.whitening import VELOCITY_OF
from sysid.logs.runs import WHEEL_SPEEDS

_TIMES: Final = (0.0, 0.1, 0.22, 0.4, 0.65, 1.0, 1.5, 2.3, 3.5)
"""Corners of the hat functions of the time since a change of command, in response times; the first and the
last have no hat of their own."""
_SIZES: Final = (0.0, 0.2, 0.5, 1.0)
"""Corners of the hat functions of the size of a change and of the speed, relative to the largest speed; 0 has
no hat of its own."""
_BEHIND: Final = (0.05, 0.2, 0.6)
"""Scales of the saturating functions of how far the speed is behind its command, relative to the largest."""
_REST: Final = 0.02
"""Speed relative to the largest one at which the sign of the motion counts half."""
_ARRIVED: Final = 0.1
"""Relative distance from its final speed at which a step response counts as ended."""
_MOST_TICKS: Final = 400
_RESPONSES_S: Final = (0.05, 3.0)
"""Range of response times [s]: shorter ones no command link shows, longer ones no run lasts for."""
_BODY: Final = ("vx_m_s", "vy_m_s", "yaw_rate_rad_s")

Key = tuple[str, str, int, int]
"""Kind of channel, group of columns, and the numbers of the hats of time and of size."""


@dataclass(frozen=True)
class ShapeBasis:
    """The units in which the columns are defined."""

    response_s: float
    """Response time of the law with its delay [s]."""
    largest: Mapping[str, float]
    """Kind of channel -> largest speed that is predicted, in the channel's unit."""

    @classmethod
    def of(cls, model: Model, observations: Observations, predictions: Sequence[FloatArray]) -> ShapeBasis:
        """Return the basis for a model whose `predictions` on some observations are given."""
        largest: dict[str, float] = {}
        for block, predicted in zip(observations.blocks, predictions, strict=True):
            kind, speed = (
                kind_of(block.channel),
                float(np.max(np.abs(_velocity(block, predicted)), initial=0.0)),
            )
            largest[kind] = max(largest.get(kind, 0.0), speed)
        return cls(response_time_s(model), {kind: speed for kind, speed in largest.items() if speed > 0.0})

    def columns(
        self, model: Model, observations: Observations, predictions: Sequence[FloatArray]
    ) -> dict[Key, list[FloatArray]]:
        """Return the columns, one array (m,) per block each, in the unit of the block's channel.

        `predictions` are the model's of the same observations. Columns that are zero everywhere are left out.
        """
        found: dict[Key, list[FloatArray]] = {}
        for index, (block, predicted) in enumerate(zip(observations.blocks, predictions, strict=True)):
            if kind_of(block.channel) not in self.largest:
                continue
            situation = observations.situations[block.situation]
            for key, part in self._of_block(model, situation, block, predicted).items():
                if np.any(part):
                    column = found.setdefault(key, [np.zeros(b.value.size) for b in observations.blocks])
                    column[index] = part
        return found

    def _of_block(
        self, model: Model, situation: Situation, block: Block, predicted: FloatArray
    ) -> dict[Key, FloatArray]:
        kind = kind_of(block.channel)
        largest = self.largest[kind]
        is_window = block.channel in VELOCITY_OF
        around = np.linspace(-0.5 * WINDOW_S, 0.5 * WINDOW_S, 21) if is_window else np.zeros(1)
        span = WINDOW_S if is_window else 1.0
        at = block.time_s[:, None] + around
        times, levels = command_levels(model, situation, block.channel)
        since = at[:, :, None] - times[1:]
        corners, sizes = self.response_s * np.array(_TIMES), largest * np.array(_SIZES)
        hats = [hat(since, corners, i).mean(axis=1) for i in range(1, len(_TIMES) - 1)]
        found: dict[Key, FloatArray] = {}
        for group, part in zip(("speeding up", "slowing down"), _parts(levels), strict=True):
            for j in range(1, len(_SIZES)):
                share = span * part * hat(np.abs(part), sizes, j)
                found |= {(kind, group, i, j): shape @ share for i, shape in enumerate(hats, 1)}
        speed = _velocity(block, predicted)
        held = levels[np.clip(np.searchsorted(times, at, side="right") - 1, 0, None)].mean(axis=1)
        for j in range(1, len(_SIZES)):
            found[kind, "speed", 0, j] = span * largest * np.sign(speed) * hat(np.abs(speed), sizes, j)
        for i, scale in enumerate(_BEHIND):
            found[kind, "behind", i, 0] = span * largest * np.tanh((held - speed) / (scale * largest))
        found[kind, "sign", 0, 0] = span * largest * np.tanh(speed / (_REST * largest))
        return found


def response_time_s(model: Model) -> float:
    """Return the time [s] after which the step response of a model's law, and its delay, are over."""
    law = model.wheel.law
    response = law.simulate(np.ones(_MOST_TICKS), LawState.steady(0.0))
    outside = np.flatnonzero(np.abs(response - response[-1]) > _ARRIVED * abs(response[-1]))
    ticks = int(outside[-1]) + 1 if outside.size else 0
    delay = model.effects.get("command_latency", {}).get("delay_s", 0.0)
    return float(np.clip(ticks * law.sample_period_s + delay, *_RESPONSES_S))


def kind_of(channel: str) -> str:
    """Return the kind of a channel: all wheels share one, and a pose is of the kind of its velocity."""
    return "wheels" if channel in ("speed_rpm", *WHEEL_SPEEDS) else VELOCITY_OF.get(channel, channel)


def command_levels(model: Model, situation: Situation, channel: str) -> tuple[FloatArray, FloatArray]:
    """Return when the command of a `channel` changes [s] and its levels, in rpm or as a body velocity.

    The model clips wheel speeds at its ceiling.
    """
    times, wheels = changes_from_rest(situation.runs[0])
    limit = model.wheel.saturation_rpm
    wheels = np.clip(wheels, -limit, limit)
    if kind_of(channel) == "wheels":
        return times, wheels[:, WHEEL_SPEEDS.index(channel) if channel in WHEEL_SPEEDS else 0]
    return times, wheels_to_body(wheels)[:, _BODY.index(kind_of(channel))]


def _parts(levels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the parts of each change, (m - 1,), that speed up and that slow down; a reversal has both."""
    before, after = levels[:-1], levels[1:]
    slower = np.where(np.abs(after) < np.abs(before), after - before, 0.0)
    braking = np.where(before * after < 0.0, -before, slower)
    return after - before - braking, braking


def _velocity(block: Block, predicted: FloatArray) -> FloatArray:
    return predicted / WINDOW_S if block.channel in VELOCITY_OF else predicted


def hat(value: FloatArray | float, corners: Sequence[float] | FloatArray, index: int) -> FloatArray:
    """Return a hat function of a `value` of any shape: 1 at the corner `index`, 0 at its neighbours.

    The last one stays 1 beyond its corner.
    """
    heights = np.zeros(len(corners))
    heights[index] = 1.0
    return np.asarray(np.interp(value, corners, heights))
