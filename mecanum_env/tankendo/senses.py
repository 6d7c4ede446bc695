"""How an observation is made: late, noisy, and with the sensor effects of the model."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mecanum_env.effects.apply import active_effects, measured
from mecanum_env.model import Model
from mecanum_env.tankendo.constants import Sensors
from mecanum_env.tankendo.observation import EXTRA_LIMIT, LIMITS, SIZE
from mecanum_env.tankendo.scene import Scenes
from mecanum_env.tankendo.sword import Sword
from mecanum_env.units import FloatArray

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
