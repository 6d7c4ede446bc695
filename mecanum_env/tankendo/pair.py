"""The physics of bouts between two robots: both are in one MuJoCo model, many bouts in one batch.

The rows are the players: with n bouts, row i is the first robot of bout i, and row n + i its second. Each
player has a frame of its own in the field, with the origin in the centre: the first one's is the field's, the
second one's is turned by half a turn. In its own frame each player starts on the side of negative x.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, TypeVar

import mujoco
import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError, require_one_of
from mecanum_env.model import Model
from mecanum_env.simulator import RobotPlant, plant_spec
from mecanum_env.simulator.body_limits import BodyLimits
from mecanum_env.tankendo.plant import DEFAULT_TIMESTEP_S, Compiled, RobotBatch, compiled_model
from mecanum_env.units import FloatArray

_Value = TypeVar("_Value", bound=np.generic)
SECOND: Final = "second_"
"""Before the names of the second robot's bodies, joints, actuators and sensors."""


def compile_pair(
    model: Model, plant: RobotPlant, timestep_s: float | None = None, *, visuals: bool = False
) -> Compiled:
    """Compile two robots of one model into one MuJoCo model, at rest in the field's centre.

    `plant` is "rollers" or "planar", `timestep_s` the upper bound of the physics step [s]; `visuals` includes
    what is only seen.

    Raises:
        InputError: no such plant, or a model that it cannot simulate.
    """
    require_one_of("plant", plant, DEFAULT_TIMESTEP_S)
    at_most = DEFAULT_TIMESTEP_S[plant] if timestep_s is None else timestep_s
    first, second = (plant_spec(model, plant, at_most, visuals=visuals) for _ in range(2))
    # All that refers to the body comes along: drives, sensors and the rollers' contacts with the floor.
    first.worldbody.add_frame().attach_body(second.body("base"), SECOND, "")
    return compiled_model(model, first.compile(), plant)


def turned(motion: FloatArray) -> FloatArray:
    """Return the `motion` of players, poses and velocities (6, m), in the frames of their opponents."""
    x, y, yaw, vx, vy, rate = motion
    return np.stack([-x, -y, yaw + np.pi, -vx, -vy, rate])


def others(values: npt.NDArray[_Value]) -> npt.NDArray[_Value]:
    """Return the values of all players, shape (..., 2n), each in the place of the player's opponent."""
    return np.roll(values, values.shape[-1] // 2, axis=-1)


class PairBatch(RobotBatch):
    """n bouts that are stepped together, by a number of `threads`; `pair` is that of `compile_pair`."""

    def __init__(self, pair: Compiled, n: int, threads: int = 1) -> None:
        super().__init__(pair, n, threads)
        self._limits: list[BodyLimits | None] = [None] * (2 * n)

    def restart_rows(self, rows: npt.NDArray[np.intp], poses: FloatArray, robots: Sequence[Compiled]) -> None:
        """Put both players of some bouts at rest.

        `rows` are those of the first players, then those of the second, shape (2m,), `poses` are in their own
        frames, shape (3, 2m), and `robots` are all the pair itself.

        Raises:
            InputError: the rows are not both players of each bout, or the robots others than the pair.
        """
        bouts, second = np.split(rows, 2)
        if not np.array_equal(second, bouts + self.n) or any(one is not self._common for one in robots):
            raise InputError("a bout begins for both of its players, with the pair that was compiled")
        self._batch.reset(bouts.tolist(), stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        firsts, seconds = np.split(poses, 2, axis=1)
        for bout, pose, other in zip(bouts.tolist(), firsts.T, seconds.T, strict=True):
            self._batch.state[bout] = self._common.rest
            mine, its = np.split(self._qpos[bout], 2)
            self._place(mine, pose)
            self._place(its, np.array([-other[0], -other[1], other[2] + np.pi]))
        for row in rows.tolist():
            self._limits[row] = self._limits_of(self._common)
        self._any_limits = self._common.limits_body

    def _controls(self, wheels: FloatArray) -> FloatArray:
        return np.concatenate([wheels[: self.n], wheels[self.n :]], axis=-1)

    def motion(self) -> FloatArray:
        """Return poses and velocities of all players in their own frames, shape (6, 2n).

        They are x, y [m], yaw [rad], vx, vy [m/s] and yaw rate [rad/s].
        """
        coordinates = zip(np.split(self._qpos.T, 2), np.split(self._qvel.T, 2), strict=True)
        first, second = (self._motion(position, velocity) for position, velocity in coordinates)
        return np.concatenate([first, turned(second)], axis=1)

    def qpos(self, row: int) -> FloatArray:
        """Return MuJoCo's generalised positions of both robots of the bout in which a row plays."""
        return super().qpos(row % self.n)

    def model_of(self, row: int) -> Model:
        """Return the model of the robot in a row."""
        return super().model_of(row % self.n)
