"""The observation: what the robot's sensors show, late, noisy, and with the model's sensor effects.

`TankendoEnv` has the table of its numbers. Positions and velocities are in the robot's body frame (x forward,
y left); velocities are over the floor. Sensor effects of the model act on what the robot measures of itself:
its velocity (10-12) and its pose in the field (16-19).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from mecanum_env.effects.apply import measured
from mecanum_env.kinematics import POSE, TWIST
from mecanum_env.model import Model
from mecanum_env.tankendo.constants import Sensors
from mecanum_env.tankendo.numbers import Many, Mathematics, Number, mathematics
from mecanum_env.tankendo.scene import Scenes
from mecanum_env.tankendo.sword import Place, Sword, on_guard
from mecanum_env.units import FloatArray

SIZE: Final = 20
"""How many numbers every task observes."""
NOISY: Final = 17
"""How many of them are noisy: all but the command."""
LIMITS: Final = np.repeat(
    [15.0, 5.0, 15.0, 3.0, 40.0, 5.0, 20.0, 1.5, 7.0, 1.5], [2, 2, 2, 1, 3, 2, 1, 3, 2, 2]
)
"""Largest absolute value of each number, to which observations are clipped, shape (20,)."""
EXTRA_LIMIT: Final = 10.0
"""Largest absolute value of the numbers that a task appends."""
_OWN = (*TWIST, *POSE)
_WINDOW = 40  # steps that a sensor effect sees: several times its longest delay or time constant


Numbers = npt.NDArray[np.floating]


@dataclass(frozen=True)
class Observed:
    """An observation by name; each field is a number, or an array (n,) of a batch."""

    opponent_x: Numbers
    opponent_y: Numbers
    """Position of the opponent ahead of the robot and to its left [m]."""
    opponent_vx: Numbers
    opponent_vy: Numbers
    """Velocity of the opponent over the floor, along the robot's axes [m/s]."""
    tip_x: Numbers
    tip_y: Numbers
    """Position of the tip ahead of the robot and to its left [m]."""
    tip_height: Numbers
    """Height of the tip over the floor [m]."""
    tip_vx: Numbers
    tip_vy: Numbers
    tip_rising: Numbers
    """Velocity of the tip, along the robot's axes and upwards [m/s]."""
    vx: Numbers
    vy: Numbers
    yaw_rate: Numbers
    """The robot's own velocity forward and to the left [m/s], and its yaw rate [rad/s]."""
    forward_share: Numbers
    left_share: Numbers
    turn_share: Numbers
    """V cos theta / 135, V sin theta / 135 and VC / 100 of the command now held."""
    x: Numbers
    y: Numbers
    """The robot's own position in the field, from its centre [m]."""
    heading_cos: Numbers
    heading_sin: Numbers
    """Cosine and sine of its own heading in the field."""


def read_observation(observation: npt.NDArray[np.floating]) -> Observed:
    """Return the numbers of an observation, shape (..., 20 or more), by name."""
    return Observed(*(observation[..., i] for i in range(SIZE)))


def noise_sizes(sensors: Sensors) -> FloatArray:
    """Return the standard deviation of each noisy number, shape (17,), of these sensors."""
    s = sensors
    seen = [*[s.position_m] * 2, *[s.velocity_m_s] * 2, *[s.position_m] * 3, *[s.tip_velocity_m_s] * 3]
    own = [*[s.own_velocity_m_s] * 2, s.own_yaw_rate_rad_s, *[s.place_m] * 2, *[s.heading_rad] * 2]
    return np.array([*seen, *own])


class Measured(Protocol):
    """A robot whose sensors are read."""

    @property
    def model(self) -> Model:
        """Its model."""

    @property
    def alters_sensors(self) -> bool:
        """Whether any effect of the model acts on its sensors."""


class Instruments:
    """The sensors of n robots, read every `step_s` [s]; the task appends `extra` numbers."""

    def __init__(self, n: int, sensors: Sensors, step_s: float, extra: int) -> None:
        self._math = mathematics(n)
        self._delay_s, self._step_s = sensors.delay_s, step_s
        self._sizes = noise_sizes(sensors)[:, None]
        highest = np.concatenate([LIMITS, np.full(extra, EXTRA_LIMIT)])[:, None]
        self._lowest, self._highest = -highest, highest
        # Rows whose model has sensor effects: the model, and the samples of the past.
        self._affected: dict[int, tuple[Model, list[FloatArray]]] = {}

    def restart(self, rows: Sequence[int], robots: Sequence[Measured]) -> None:
        """Begin an episode in some rows, in which the sensor effects of the robots' models act."""
        for row, robot in zip(rows, robots, strict=True):
            if self._affected:
                self._affected.pop(row, None)
            if robot.alters_sensors:
                self._affected[row] = (robot.model, [])

    def acts_on(self, rows: npt.NDArray[np.intp]) -> bool:
        """Return whether sensor effects act in any of some rows (m,)."""
        return bool(self._affected) and any(row in self._affected for row in rows.tolist())

    def observe(
        self,
        scenes: Scenes,
        time_s: Number,
        sword: Sword,
        shares: Sequence[Number],
        noise: FloatArray,
        extra: Sequence[Number],
    ) -> npt.NDArray[np.float32]:
        """Return observations, shape (n, 20 + k).

        Args:
            scenes: poses and velocities, now and before.
            time_s: now.
            sword: the opponents' swords.
            shares: the command now held, as shares of the full one: forward, left, turn.
            noise: standard normal noise, shape (17, n).
            extra: the k numbers that the task appends.
        """
        scene = scenes.seen(self._delay_s)
        tip, tip_velocity = sword.tip_and_velocity(time_s - self._delay_s, scene)
        shown = self._shown(self._math, scene, tip, tip_velocity, shares, extra)
        x, y, yaw = scene[:3]
        for row in self._affected:
            pose = np.array([self._math.array(number)[row] for number in (x, y, yaw)])
            self._apply_effects(row, shown, pose, float(self._math.array(time_s)[row]))
        return self._read(shown, noise)

    def observe_first(
        self, scene: FloatArray, noise: FloatArray, extra: Sequence[Number]
    ) -> npt.NDArray[np.float32]:
        """Return what `observe` does of m episodes that begin in a `scene`, (11, m), without sensor effects.

        Nobody moves, and the swords are on guard. `noise` has the shape (17, m); `extra` are k arrays (m,).
        """
        m = scene.shape[1]
        math, (x, y, heading) = Many(m), scene[6:9]
        nothing = np.zeros(m)
        tip = on_guard((x, y), (math.cos(heading), math.sin(heading)))
        shown = self._shown(math, list(scene), tip, (nothing,) * 3, (nothing,) * 3, extra)
        return self._read(shown, noise)

    def _shown(
        self,
        math: Mathematics,
        scene: Sequence[Number],
        tip: Place,
        tip_velocity: Place,
        shares: Sequence[Number],
        extra: Sequence[Number],
    ) -> FloatArray:
        """Return what flawless sensors show of episodes by `math`, shape (20 + k, n)."""
        x, y, yaw, vx, vy, rate, other_x, other_y, _, other_vx, other_vy = scene
        cos, sin = math.cos(yaw), math.sin(yaw)

        def on_robot(along_x: Number, along_y: Number) -> tuple[Number, Number]:
            """Return a vector's components ahead of the robot and to its left."""
            return cos * along_x + sin * along_y, cos * along_y - sin * along_x

        return math.table(
            [
                *on_robot(other_x - x, other_y - y),
                *on_robot(other_vx, other_vy),
                *(*on_robot(tip[0] - x, tip[1] - y), tip[2]),
                *(*on_robot(tip_velocity[0], tip_velocity[1]), tip_velocity[2]),
                *(*on_robot(vx, vy), rate),
                *shares,
                *(x, y, cos, sin),
                *extra,
            ]
        )

    def _read(self, shown: FloatArray, noise: FloatArray) -> npt.NDArray[np.float32]:
        """Return what is `shown`, (20 + k, n), with `noise` (17, n) and within its limits, (n, 20 + k)."""
        noise = self._sizes * noise
        # Named, since a sum in place of a slice is written back into the slice, too.
        before_command, behind_it = shown[:13], shown[16:20]
        before_command += noise[:13]
        behind_it += noise[13:]
        np.minimum(np.maximum(shown, self._lowest, out=shown), self._highest, out=shown)
        # One episode after the other in memory, since whoever takes a copy wants it so.
        return np.ascontiguousarray(shown.T.astype(np.float32))

    def _apply_effects(self, row: int, shown: FloatArray, pose: FloatArray, now_s: float) -> None:
        """Write into `shown` what the sensors of one row measure of its own motion; `pose` is exact, (3,)."""
        model, past = self._affected[row]
        if past and past[-1][0] == now_s:
            past.pop()  # observed a second time in this step, since another row was reset
        sample = np.array([now_s, *shown[10:13, row], *pose])
        if not past:
            past.append(np.array([-np.inf, *sample[1:]]))  # at rest before; a filter needs two samples
        past.append(sample)
        del past[:-_WINDOW]
        channels = dict(zip(_OWN, np.array(past).T[1:], strict=True))
        clock = now_s - self._step_s * np.arange(len(past) - 1.0, -1.0, -1.0)
        now = measured(model, clock, channels)
        shown[10:13, row] = [now[name][-1] for name in _OWN[:3]]
        shown[16:18, row] = [now[name][-1] for name in _OWN[3:5]]
        shown[18, row], shown[19, row] = np.cos(now["yaw_rad"][-1]), np.sin(now["yaw_rad"][-1])
