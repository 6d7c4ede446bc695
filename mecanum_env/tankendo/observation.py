"""What the robot's sensors tell: the observation, number by number.

Positions and velocities are in the robot's body frame (x forward, y left), velocities are over the floor.
All of it is as it was `Sensors.delay_s` ago, with normal noise of the given standard deviation.
Effects of the model on sensors act on 10-12 and 16-19, what the robot measures of itself
(`mecanum_env.tankendo.observation`).

| index | quantity | unit | noise |
|---|---|---|---|
| 0, 1 | place of the opponent: ahead, left | m | 0.01 |
| 2, 3 | velocity of the opponent: ahead, left | m/s | 0.05 |
| 4, 5, 6 | tip of its sword: ahead, left, height over the floor | m | 0.01 |
| 7, 8, 9 | velocity of the tip: ahead, left, up | m/s | 0.1 |
| 10, 11, 12 | own velocity: ahead, left; yaw rate | m/s, m/s, rad/s | 0.02, 0.02, 0.02 |
| 13, 14, 15 | the command now held: V cos theta / 135, V sin theta / 135, VC / 100 | 1 | 0 |
| 16, 17 | own place in the field, from its centre: x, y | m | 0.02 |
| 18, 19 | cosine and sine of the own heading in the field | 1 | 0.01 |

The duel adds 20, 21: points of the robot and of the opponent; 22: 1 while the robot's own sword strikes.

How an observation is made: late, noisy, and with the sensor effects of the model.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.effects.apply import active_effects, measured
from mecanum_env.model import Model
from mecanum_env.tankendo.constants import Sensors
from mecanum_env.tankendo.scene import Scenes
from mecanum_env.tankendo.sword import Sword
from mecanum_env.units import FloatArray

SIZE: Final = 20
"""Numbers that every task observes."""
NOISY: Final = 17
"""Of them with noise: all but the command."""
LIMITS: Final = np.array(
    [15.0] * 2
    + [5.0] * 2
    + [15.0] * 2
    + [3.0]
    + [40.0] * 3
    + [5.0, 5.0, 20.0]
    + [1.5] * 3
    + [7.0] * 2
    + [1.5] * 2
)
"""Largest absolute value of each number; observations are clipped to it."""
EXTRA_LIMIT: Final = 10.0
"""The same for what a task adds."""


@dataclass(frozen=True)
class Observed:
    """An observation by name; each field is a float, or an array (n,) of a batch."""

    opponent_x: npt.NDArray[np.floating]
    """Ahead of the robot [m]."""
    opponent_y: npt.NDArray[np.floating]
    """Left of the robot [m]."""
    opponent_vx: npt.NDArray[np.floating]
    """Over the floor, along the robot's axis [m/s]."""
    opponent_vy: npt.NDArray[np.floating]
    """Over the floor, to the robot's left [m/s]."""
    tip_x: npt.NDArray[np.floating]
    """[m]"""
    tip_y: npt.NDArray[np.floating]
    """[m]"""
    tip_height: npt.NDArray[np.floating]
    """[m]"""
    tip_vx: npt.NDArray[np.floating]
    """[m/s]"""
    tip_vy: npt.NDArray[np.floating]
    """[m/s]"""
    tip_rising: npt.NDArray[np.floating]
    """[m/s]"""
    vx: npt.NDArray[np.floating]
    """Own [m/s]."""
    vy: npt.NDArray[np.floating]
    """Own [m/s]."""
    yaw_rate: npt.NDArray[np.floating]
    """Own [rad/s]."""
    forward_share: npt.NDArray[np.floating]
    """Of the command now held, V cos theta / 135."""
    left_share: npt.NDArray[np.floating]
    """V sin theta / 135."""
    turn_share: npt.NDArray[np.floating]
    """VC / 100."""
    x: npt.NDArray[np.floating]
    """Own place in the field [m]."""
    y: npt.NDArray[np.floating]
    """Own place in the field [m]."""
    heading_cos: npt.NDArray[np.floating]
    heading_sin: npt.NDArray[np.floating]


def read_observation(observation: npt.NDArray[np.floating]) -> Observed:
    """Return the numbers of an observation, shape (..., 20 or more), by name."""
    return Observed(*(observation[..., i] for i in range(SIZE)))


_OWN = ("vx_m_s", "vy_m_s", "yaw_rate_rad_s", "x_m", "y_m", "yaw_rad")
_WINDOW = 40  # steps of the past that a sensor effect sees: several times its longest delay or filter


def noise_sizes(sensors: Sensors) -> FloatArray:
    """Return the standard deviation of each noisy number, shape (17,), of these sensors."""
    s = sensors
    seen = [*[s.position_m] * 2, *[s.velocity_m_s] * 2, *[s.position_m] * 3, *[s.tip_velocity_m_s] * 3]
    own = [*[s.own_velocity_m_s] * 2, s.own_yaw_rate_rad_s, *[s.place_m] * 2, *[s.heading_rad] * 2]
    return np.array([*seen, *own])


class Senses:
    """The sensors of some robots.

    Args:
        sensors: delay and noise.
        step_s: time between two observations.
        extra: numbers that the task adds.
    """

    def __init__(self, sensors: Sensors, step_s: float, extra: int) -> None:
        self._delay_s, self._step_s = sensors.delay_s, step_s
        self._sizes = noise_sizes(sensors)[:, None]
        self._limits = np.concatenate([LIMITS, np.full(extra, EXTRA_LIMIT)])[:, None]
        self._affected: dict[int, tuple[Model, list[FloatArray]]] = {}

    def restart(self, row: int, model: Model) -> None:
        """Begin an episode in one row, with this model's sensor effects."""
        self._affected.pop(row, None)
        if any(effect.change_channels is not None for effect, _ in active_effects(model)):
            self._affected[row] = (model, [])

    def observe(
        self,
        scenes: Scenes,
        time_s: FloatArray,
        sword: Sword,
        held: FloatArray,
        noise: FloatArray,
        extra: FloatArray,
    ) -> npt.NDArray[np.float32]:
        """Return observations, shape (n, 20 + extra).

        Args:
            scenes: where everybody is and was.
            time_s: now, (n,).
            sword: the opponent's.
            held: shares of the command now held, (3, n).
            noise: standard normal, (17, n).
            extra: what the task adds, (k, n).
        """
        seen = scenes.ago(self._delay_s)
        cos, sin = np.cos(seen[2]), np.sin(seen[2])
        tip, tip_velocity = sword.tip_and_velocity(time_s - self._delay_s, seen)
        shown = np.empty((SIZE + len(extra), len(time_s)))
        for index, x, y in (
            (0, seen[6] - seen[0], seen[7] - seen[1]),
            (2, seen[9], seen[10]),
            (4, tip[0] - seen[0], tip[1] - seen[1]),
            (7, tip_velocity[0], tip_velocity[1]),
            (10, seen[3], seen[4]),
        ):
            # From the field's frame into the body's.
            shown[index], shown[index + 1] = cos * x + sin * y, cos * y - sin * x
        shown[6], shown[9], shown[12] = tip[2], tip_velocity[2], seen[5]
        shown[13:16], shown[16:18] = held, seen[:2]
        shown[18], shown[19] = cos, sin
        for row in self._affected:
            self._measure(row, shown, seen, float(time_s[row]))
        noise = self._sizes * noise
        shown[:13] += noise[:13]
        shown[16:20] += noise[13:]
        shown[20:] = extra
        np.minimum(np.maximum(shown, -self._limits, out=shown), self._limits, out=shown)
        return shown.T.astype(np.float32)

    def _measure(self, row: int, shown: FloatArray, seen: FloatArray, now_s: float) -> None:
        """Write into `shown` what the sensors of one row make of its own motion."""
        model, past = self._affected[row]
        if past and past[-1][0] == now_s:
            past.pop()  # asked again, since an episode began beside it: no further sample
        sample = np.array([now_s, *shown[10:13, row], *seen[:3, row]])
        if not past:
            past.append(np.array([-np.inf, *sample[1:]]))  # at rest before; a filter needs two samples
        past.append(sample)
        del past[:-_WINDOW]
        channels = dict(zip(_OWN, np.array(past).T[1:], strict=True))
        clock = np.asarray(np.arange(len(past)) * self._step_s, float)
        now = measured(model, clock, channels)
        shown[10:13, row] = [now[name][-1] for name in _OWN[:3]]
        shown[16:18, row] = [now[name][-1] for name in _OWN[3:5]]
        shown[18, row], shown[19, row] = np.cos(now["yaw_rad"][-1]), np.sin(now["yaw_rad"][-1])
