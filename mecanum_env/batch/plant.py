"""The robots without slip: drives and bodies of a batch, one command period a call.

The body moves as MuJoCo's integrator "implicitfast" moves that of `mecanum_env.mjcf.planar_spec`: with v the
velocity in the body's axes at the start of a physics step, R its rotation, and the wheels' torques t,

    v' = v + h (M + h (D + kv G'G))^-1 (G't - D v + w^2 (m c) + gravity),    position' = position + h R v'

where G are the wheels' speeds per velocity, m c is mass times offset of its centre, and w the yaw rate. A
body whose centre of mass is in its middle is one that MuJoCo calls simple: of h kv G'G, in the world's axes,
it then keeps the diagonal alone, and so does this batch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from mecanum_env.batch.arrays import Arrays, OnArrays
from mecanum_env.batch.latches import LINK, Latches
from mecanum_env.batch.limits import BatchLimits
from mecanum_env.batch.numbers import PlanarRobot
from mecanum_env.batch.set_points import SetPoints
from mecanum_env.batch.store import Store
from mecanum_env.errors import InputError
from mecanum_env.kinematics import body_to_wheels, command_to_wheels
from mecanum_env.model import Model
from mecanum_env.simulator import SimulationDivergedError
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.chain import DriveState
from mecanum_env.wheel_drive.parameters import CHAIN
from mecanum_env.wheel_drive.servo import end, torques

_STATE = [field.name for field in fields(DriveState) if field.init]
_LINK = [CHAIN.index(name) for name in LINK]
_LARGEST = 1e10  # speeds beyond this have diverged, as for MuJoCo


class PlanarBatch(OnArrays):
    """n robots that are stepped together, each with a law and effects of its own.

    All have the `common` robot's until `restart` replaces one. `device` is None for numpy, or one of torch's,
    such as "cpu" or "cuda". All robots have the clocks of the common one.
    """

    def __init__(self, common: PlanarRobot, n: int, device: str | None = None) -> None:
        arrays = Arrays(device)
        super().__init__(arrays)
        self.n, self._common, self.clocks = n, common, common.clocks
        if device is not None and any(any(program) for program in common.programs.values()):
            raise InputError("custom effects are computed by numpy only; leave out the device")
        self._store = Store(common, n, arrays)
        array = arrays.array
        self._of = [common] * n
        latches = Latches(n, self.clocks.drive_period_s, arrays)
        self._set_points = SetPoints(latches, self.clocks.sample_period_s, self.clocks.timestep_s, arrays)
        self._limits = BatchLimits(common, n, arrays) if common.limits else None
        # Every part of a drive replaces the arrays of its state: what no part writes stays this one.
        self._rest = array(np.zeros((4, n)))
        self._drives = DriveState(**dict.fromkeys(_STATE, self._rest))
        self._steps = np.zeros(n)
        self._pose, self._velocity = array(np.zeros((3, n))), array(np.zeros((3, n)))
        self._mixing = array(body_to_wheels(np.eye(3)).T)  # (4, 3)
        self._take_over(np.arange(n), [common] * n)
        self.restart_rows(np.arange(n), np.zeros((3, n)))

    def restart(self, row: int, pose: Sequence[float], compiled: PlanarRobot | None = None) -> None:
        """Put the robot of a row at rest at a pose x [m], y [m], yaw [rad].

        From now on it is `compiled`, or the common robot when None.

        Raises:
            InputError: a robot that does not go with the common one.
        """
        self.restart_rows(
            np.array([row]), np.array(pose, float)[:, None], [self._common if compiled is None else compiled]
        )

    def restart_rows(
        self, rows: np.ndarray[Any, Any], poses: FloatArray, robots: list[PlanarRobot] | None = None
    ) -> None:
        """Put the robots of some `rows` (m,) at rest at `poses`, shape (3, m): x [m], y [m], yaw [rad].

        From now on they are `robots`, one for each, or the common robot when None. Others are not touched.

        Raises:
            InputError: a robot that does not go with the common one.
        """
        new = [self._common] * len(rows) if robots is None else robots
        changed = [i for i, row in enumerate(rows.tolist()) if new[i] is not self._of[row]]
        for robot in (new[i] for i in changed):
            same_clocks = robot.clocks is self.clocks or robot.clocks == self.clocks
            if not same_clocks or bool(robot.limits) != (self._limits is not None):
                raise InputError(
                    "robots of one batch must have the same command period, sample period and physics step, "
                    "and all or none limits on the body's command"
                )
        self._set_points.restart(rows)
        if changed:
            self._put(rows[changed], [new[i] for i in changed])
        if self._limits is not None:
            self._limits.restart(rows, new)
        at = self._array(rows)
        for name in _STATE:
            state = getattr(self._drives, name)
            if state is not self._rest:
                state[:, at] = 0.0
        self._steps[rows] = 0.0
        self._pose[:, at], self._velocity[:, at] = self._array(poses), 0.0

    def _put(self, rows: np.ndarray[Any, Any], robots: list[PlanarRobot]) -> None:
        """Give some `rows` (m,) other `robots`, one for each."""
        self._store.put(rows, robots)
        for row, robot in zip(rows.tolist(), robots, strict=True):
            self._of[row] = robot
        self._take_over(rows, robots)

    def _take_over(self, rows: np.ndarray[Any, Any], robots: list[PlanarRobot]) -> None:
        """Bring the set-points up to date with the parameters of `robots` that are new in some `rows`."""
        links = np.stack([robot.drives[:, 0] for robot in robots], axis=-1)[_LINK]
        self._set_points.latches.take(rows, dict(zip(LINK, links, strict=True)))
        self._set_points.take(self._store.p)

    def step(self, commands: FloatArray) -> None:
        """Simulate one command period with rounded commands V [rpm], theta [deg], VC [rpm], shape (n, 3).

        Raises:
            SimulationDivergedError: a state is no longer finite or plausible.
        """
        sent = self._array(command_to_wheels(commands[:, 0], commands[:, 1], commands[:, 2]).T.copy())
        for _ in range(self.clocks.substeps):
            self._substep(sent)
            self._steps = self._steps + 1.0
        sane = abs(self._velocity) <= _LARGEST
        if not bool(sane.all()):
            row = int(np.argmin(self._arrays.numpy(sane.all(0))))
            raise SimulationDivergedError(
                f"robot {row} diverged; use a shorter timestep or a less stiff servo"
            )

    def _substep(self, sent: Any) -> None:
        xp, h, b, s = self._xp, self.clocks.timestep_s, self._store.body, self._drives
        p, parts = self._store.p, self._store.parts
        yaw, (vx, vy, turn) = self._pose[2], self._velocity
        cos, sin = xp.cos(yaw), xp.sin(yaw)
        forward, left = cos * vx + sin * vy, cos * vy - sin * vx
        gear = b["gear_forward"], b["gear_left"], b["gear_turn"]
        speed = self._mixing @ xp.stack([gear[0] * forward, gear[1] * left, gear[2] * turn])
        commands = sent if self._limits is None else self._limits.step(sent, self._steps)
        self._set_points.begin(s, p, commands, self._steps, speed)
        s.substeps = self._array(self._steps + 1.0) if parts.friction or parts.custom else 0
        acted = torques(s, p, speed, h, 0.0, parts)
        pushes = self._mixing.T @ acted.reported
        rate2 = turn * turn
        force_x = gear[0] * pushes[0] - b["damping"] * forward + b["moment_x"] * rate2
        force_y = gear[1] * pushes[1] - b["damping"] * left + b["moment_y"] * rate2
        moment = gear[2] * pushes[2] - b["damping_turn"] * turn
        if self._store.slopes:
            ahead = cos * b["gravity_x"] + sin * b["gravity_y"]
            across = cos * b["gravity_y"] - sin * b["gravity_x"]
            force_x, force_y = force_x + b["weight_kg"] * ahead, force_y + b["weight_kg"] * across
            moment = moment + b["moment_x"] * across - b["moment_y"] * ahead
        if self._store.rollers:
            for x in (-b["arm"], b["arm"]):
                sideways = left + x * turn
                held = 2.0 * (b["rub"] * xp.tanh(sideways / b["rest"]) + b["drag"] * sideways)
                force_y, moment = force_y - held, moment - x * held
        forward, left, turn = self._moved((cos, sin), (forward, left, turn), (force_x, force_y, moment))
        after = self._mixing @ xp.stack([gear[0] * forward, gear[1] * left, gear[2] * turn])
        end(s, p, acted, speed, after, h, parts)
        vx, vy = cos * forward - sin * left, sin * forward + cos * left
        self._velocity = xp.stack([vx, vy, turn])
        self._pose = self._pose + h * self._velocity

    def _moved(self, heading: Any, velocity: Any, force: Any) -> tuple[Any, Any, Any]:
        """Return the velocity after a physics step, in the body's axes, by forces along them and a moment."""
        h, b, store = self.clocks.timestep_s, self._store.body, self._store
        (forward, left, turn), (along, across, moment) = velocity, force
        simple = coupled = (0.0, 0.0)
        turned = b["mobility_22"] * moment
        if not store.none_simple:
            cos, sin = heading
            cos2, sin2 = cos * cos, sin * sin
            x = (cos * along - sin * across) / (b["moved_forward"] * cos2 + b["moved_left"] * sin2)
            y = (sin * along + cos * across) / (b["moved_forward"] * sin2 + b["moved_left"] * cos2)
            simple = cos * x + sin * y, cos * y - sin * x
        if not store.all_simple:
            coupled = (
                b["mobility_00"] * along + b["mobility_01"] * across + b["mobility_02"] * moment,
                b["mobility_01"] * along + b["mobility_11"] * across + b["mobility_12"] * moment,
            )
            turned = turned + b["mobility_02"] * along + b["mobility_12"] * across
        if store.all_simple or store.none_simple:
            ahead, aside = simple if store.all_simple else coupled
        else:
            which = b["is_simple"] > 0.0
            ahead, aside = (self._xp.where(which, *pair) for pair in zip(simple, coupled, strict=True))
        return forward + h * ahead, left + h * aside, turn + h * turned

    def motion(self) -> FloatArray:
        """Return poses and velocities: x, y [m], yaw [rad], vx, vy [m/s], yaw rate [rad/s], shape (6, n).

        They are in the field's frame; yaw is unwrapped.
        """
        both = self._xp.concatenate([self._pose, self._velocity])
        return np.asarray(self._arrays.numpy(both), float)

    def qpos(self, row: int) -> FloatArray:
        """Return MuJoCo's generalised positions of the robot in a row, for drawing."""
        return np.array(self._arrays.numpy(self._pose[:, row]), float)

    def compiled_of(self, row: int) -> PlanarRobot:
        """Return the robot in a row, ready to simulate."""
        return self._of[row]

    def model_of(self, row: int) -> Model:
        """Return the model of the robot in a row."""
        return self._of[row].model
