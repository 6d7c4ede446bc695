"""The robot's senses in the simulator: frames and own readings of n episodes, and the estimate made of them.

With `senses` an environment's observation is the estimate of `mecanum_env.senses.Estimator` instead of the
late and noisy picture of `Sensors`; its 20 numbers and their age stay the same, so every controller and every
policy plays with either. Everything random is drawn at the start of an episode.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import numpy.typing as npt

from mecanum_env.senses import CameraFrame, Estimate, Estimator, OwnReading, Senses, VariedSenses
from mecanum_env.tankendo.numbers import mathematics
from mecanum_env.tankendo.observation import LIMITS, SIZE
from mecanum_env.tankendo.scene import BoolArray, Scenes
from mecanum_env.tankendo.sword import Sword
from mecanum_env.units import FloatArray

_FRAME_NUMBERS, _OWN_NUMBERS = 5, 6


def longest_delay_s(senses: Senses | VariedSenses) -> float:
    """Return the largest delay of a frame that these senses may have [s]."""
    if isinstance(senses, Senses):
        return senses.camera_delay_s
    return float(senses.ranges.get("camera_delay_s", (0.0, senses.base.camera_delay_s))[1])


def estimated_observation(estimate: Estimate, shares: FloatArray) -> FloatArray:
    """Return the observation that an estimate amounts to, shape (20, n), clipped as every observation.

    `shares` are the command now held as shares of the full one: ahead, left, turn, shape (3, n). This is how
    a real robot fills in what a controller sees.
    """
    heading = estimate.own_pose[2]
    observation = np.concatenate(
        [
            estimate.opponent_m,
            estimate.opponent_m_s,
            estimate.tip_m,
            estimate.tip_m_s,
            estimate.own_velocity,
            shares,
            estimate.own_pose[:2],
            np.cos(heading)[None],
            np.sin(heading)[None],
        ]
    )
    return np.asarray(np.clip(observation, -LIMITS[:, None], LIMITS[:, None]), float)


class Sensing:
    """The senses of n episodes of at most `steps` steps of `step_s` [s].

    `age_s` is the age of an observation [s], as controllers expect it; own readings are as old.
    """

    def __init__(
        self, senses: Senses | VariedSenses, n: int, steps: int, step_s: float, age_s: float
    ) -> None:
        self._senses, self._step_s, self._age_s = senses, step_s, age_s
        usual = senses if isinstance(senses, Senses) else senses.base
        self._frames = max(1, round(step_s / usual.frame_s))
        self.estimator = Estimator(n, usual, age_s)
        self.of: list[Senses] = [usual] * n
        """The senses of each episode."""
        self._numbers = {one.name: np.full(n, getattr(usual, one.name)) for one in fields(Senses)}
        # The numbers of an episode are together in memory: they are drawn at once.
        self._normal = np.zeros((n, steps + 1, _FRAME_NUMBERS * self._frames + _OWN_NUMBERS))
        self._uniform = np.zeros((n, steps + 1, 2 * self._frames + 1))
        self._lost = np.zeros((2, n), bool)
        self._done_s = np.full(n, np.nan)
        self._all, self._math = np.arange(n), mathematics(n)
        self._shown = np.zeros((SIZE, n))

    def restart(self, row: int, rng: np.random.Generator) -> None:
        """Begin an episode in a row, all of whose chance is drawn from the generator `rng` now."""
        self.of[row] = self._senses if isinstance(self._senses, Senses) else self._senses.draw(rng)
        for name, values in self._numbers.items():
            values[row] = getattr(self.of[row], name)
        rng.standard_normal(out=self._normal[row])
        rng.random(out=self._uniform[row])
        self._lost[:, row] = False
        self._done_s[row] = np.nan
        self.estimator.restart(row)

    def observe(
        self, truth: npt.NDArray[np.floating], scenes: Scenes, time_s: FloatArray, sword: Sword
    ) -> npt.NDArray[np.float32]:
        """Return observations, shape (n, 20 + k): the estimate, and what the task appends unchanged.

        Args:
            truth: what flawless sensors show, with the sensor effects of the robots, shape (n, 20 + k).
            scenes: poses and velocities, now and before.
            time_s: now, shape (n,).
            sword: the opponents' swords.
        """
        # A second look within a step, since another row was reset, brings no new readings.
        fresh = time_s != self._done_s
        if fresh.any():
            exact = np.asarray(truth.T, float)
            step = np.minimum(np.rint(time_s / self._step_s).astype(np.intp), self._normal.shape[1] - 1)
            normal, uniform = self._normal[self._all, step].T, self._uniform[self._all, step].T
            own = self._own(exact, time_s, normal[-_OWN_NUMBERS:], uniform[-1])
            frames = [
                self._frame(
                    k,
                    scenes,
                    time_s,
                    sword,
                    normal[_FRAME_NUMBERS * k : _FRAME_NUMBERS * (k + 1)],
                    uniform[2 * k : 2 * k + 2],
                    fresh,
                )
                for k in range(self._frames)
            ]
            estimate = self.estimator.update(time_s, own, frames, fresh)
            self._done_s = np.where(fresh, time_s, self._done_s)
            self._shown = np.where(fresh, estimated_observation(estimate, exact[13:16]), self._shown)
        shown = self._shown.T.astype(np.float32)
        return np.concatenate([shown, truth[:, SIZE:].astype(np.float32)], axis=1)

    def _own(
        self, truth: FloatArray, time_s: FloatArray, normal: FloatArray, uniform: FloatArray
    ) -> OwnReading:
        numbers = self._numbers
        velocity = truth[10:13] + normal[:3] * np.stack(
            [*[numbers["own_velocity_m_s"]] * 2, numbers["own_yaw_rate_rad_s"]]
        )
        heading = np.arctan2(truth[19], truth[18])
        pose = np.stack([truth[16], truth[17], heading]) + normal[3:] * np.stack(
            [*[numbers["place_m"]] * 2, numbers["heading_rad"]]
        )
        lost = uniform < numbers["own_lost"]
        velocity[:, lost] = pose[:, lost] = np.nan
        return OwnReading(time_s - self._age_s, velocity, pose)

    def _frame(
        self,
        k: int,
        scenes: Scenes,
        time_s: FloatArray,
        sword: Sword,
        normal: FloatArray,
        uniform: FloatArray,
        fresh: BoolArray,
    ) -> CameraFrame:
        numbers = self._numbers
        age_s = numbers["camera_delay_s"] + (self._frames - 1 - k) * self._step_s / self._frames
        seen = scenes.ago_of(self._all, age_s)
        then, x, y, heading = map(self._math.of, (time_s - age_s, *seen[6:9]))
        facing = self._math.cos(heading), self._math.sin(heading)
        tip = self._math.table(sword.tip(then, (x, y), facing))
        cos, sin = np.cos(seen[2]), np.sin(seen[2])
        places = []
        for x, y in ((seen[6] - seen[0], seen[7] - seen[1]), (tip[0] - seen[0], tip[1] - seen[1])):
            places.append(np.stack([cos * x + sin * y, cos * y - sin * x]))
        noise = numbers["position_m"] * normal
        body, tip = places[0] + noise[:2], np.stack([*places[1], tip[2]]) + noise[2:]
        # A target that is found is lost with the first chance, one that is lost stays so with the second.
        begins = numbers["lost"] / ((1.0 - numbers["lost"]) * numbers["lost_frames"])
        lost = uniform < np.where(self._lost, 1.0 - 1.0 / numbers["lost_frames"], begins)
        self._lost = np.where(fresh, lost, self._lost)
        body[:, self._lost[0]] = np.nan
        tip[:, self._lost[1]] = np.nan
        return CameraFrame(time_s - age_s, body, tip)
