"""The physics of n robots in one batch: commands in, poses and velocities out, one command period a call."""

from __future__ import annotations

import copy
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import mujoco
import numpy as np
import numpy.typing as npt
from mujoco.batch import Batch

from mecanum_env.effects.apply import active_effects, alters_sensors, check_effects, drive_parameters
from mecanum_env.errors import InputError, require_one_of
from mecanum_env.kinematics import command_to_wheels, command_wheels
from mecanum_env.mjcf import TRAINING_TIMESTEP_S
from mecanum_env.mjcf.rewrite import TEMPLATES, Template, is_rewritable
from mecanum_env.model import Model
from mecanum_env.plugin.layout import seed_links
from mecanum_env.simulator import RobotPlant, SimulationDivergedError, compile_plant
from mecanum_env.simulator.body_limits import BodyLimits, behind_limits, limits_body
from mecanum_env.simulator.robot import at_rest
from mecanum_env.tankendo.numbers import mathematics
from mecanum_env.units import FloatArray

DEFAULT_TIMESTEP_S: Final[dict[RobotPlant, float]] = {"planar": 1 / 120, "rollers": TRAINING_TIMESTEP_S}
"""Upper bound of the physics step [s]. For the planar plant it is the time step of the paper's wheel law."""
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_BATCH_FIELDS: Final = ("_batch", "_qpos", "_qvel", "_ctrl")


@dataclass(frozen=True)
class Compiled:
    """A model, ready to simulate."""

    model: Model
    mj_model: mujoco.MjModel
    rest: FloatArray
    """Integration state of the robot at rest in the field's centre, heading along x."""
    link_seed: int | None = None
    """What the chance of its link, jitter and loss of commands, follows from; None: the model's own."""

    @cached_property
    def stance(self) -> FloatArray:
        """MuJoCo's generalised positions at rest, shape (nq,)."""
        found = np.zeros(self.mj_model.nq)
        mujoco.mj_extractState(self.mj_model, self.rest, _STATE, found, mujoco.mjtState.mjSTATE_QPOS)
        return found

    @cached_property
    def limits_body(self) -> bool:
        """Whether its command is limited as a whole."""
        return limits_body(self.model)

    @cached_property
    def has_random_link(self) -> bool:
        """Whether the delay of its commands jitters or commands are lost."""
        # Most models have none of the effects that can do so, and the drive takes longer.
        if not any(effect.station == "command" for effect, _ in active_effects(self.model)):
            return False
        drive = drive_parameters(self.model)
        return drive.jitter_s > 0.0 or drive.loss > 0.0

    @cached_property
    def alters_sensors(self) -> bool:
        """Whether effects act on what it measures of itself."""
        return alters_sensors(self.model)

    def with_link_seed(self, seed: int) -> Compiled:
        """Return the same robot with other chance of its link, from 0 to `wheel_drive.link.MOST_SEEDS`."""
        mj_model = copy.copy(self.mj_model)
        seed_links(mj_model, seed)
        return replace(self, mj_model=mj_model, link_seed=seed)


def compile_model(model: Model, plant: RobotPlant, timestep_s: float | None = None) -> Compiled:
    """Compile a robot without what is only seen, and without sensors, which are read off the state.

    `plant` is "rollers" or "planar", `timestep_s` the upper bound of the physics step [s], by default that in
    `DEFAULT_TIMESTEP_S`.

    Raises:
        InputError: no such plant, or a model that it cannot simulate.
    """
    require_one_of("plant", plant, DEFAULT_TIMESTEP_S)
    at_most = DEFAULT_TIMESTEP_S[plant] if timestep_s is None else timestep_s
    return compiled_model(model, compile_plant(model, plant, at_most, visuals=False), plant)


def compiled_model(
    model: Model, mj_model: mujoco.MjModel, plant: RobotPlant, stance: FloatArray | None = None
) -> Compiled:
    """Return a compiled model with its state at rest on its plant; its sensors are switched off.

    On rollers it stands in the `stance` (nq,), by default where it settles.
    """
    mj_model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_SENSOR
    rest = np.zeros(mujoco.mj_stateSize(mj_model, _STATE))
    # The planar plant has nothing that settles, and all its numbers are 0 at rest: drawn robots start sooner.
    if plant == "rollers":
        mujoco.mj_getState(mj_model, at_rest(mj_model, stance=stance), rest, _STATE)
    return Compiled(model, mj_model, rest)


class DrawnRobots:
    """Compiles robots for the physics of a plant as `compile_model` does with this `timestep_s`.

    Robots that differ in numbers alone are written over a copy of the first one, if law and commands have the
    same periods; on rollers, if the dimensions are the same, too. The compiled model is the same bit for bit.
    On rollers such a robot begins where the first one stands: to settle takes longer than five steps of an
    episode, and the contacts of another robot differ by less than a micrometre in height.
    """

    def __init__(self, plant: RobotPlant, timestep_s: float | None) -> None:
        self._plant, self._timestep_s = plant, timestep_s
        # Never another one later, since an episode must not depend on those before it.
        self._first: Compiled | None = None
        self._template: Template | None = None

    def __call__(self, model: Model) -> Compiled:
        """Return the model, ready to simulate.

        Raises:
            InputError: a model that the plant cannot simulate.
        """
        if not is_rewritable(model, self._plant):
            return compile_model(model, self._plant, self._timestep_s)
        behind = behind_limits(model)
        if self._first is None or self._template is None:
            self._first = compile_model(model, self._plant, self._timestep_s)
            self._template = TEMPLATES[self._plant](behind, self._first.mj_model)
            return self._first
        if behind is not model:
            check_effects(model, self._plant)
        if _same_clocks(model, self._first.model):
            mj_model = self._template.with_numbers_of(behind)
            if mj_model is not None:
                robot = compiled_model(model, mj_model, self._plant, self._first.stance)
                # When its episode is over, the next robot is written over it.
                weakref.finalize(robot, self._template.spares.append, mj_model).atexit = False
                return robot
        return compile_model(model, self._plant, self._timestep_s)


def _same_clocks(one: Model, other: Model) -> bool:
    return (
        one.wheel.law.sample_period_s == other.wheel.law.sample_period_s
        and one.wheel.command_period_s == other.wheel.command_period_s
    )


class RobotBatch:
    """A batch of n robots that are stepped together, each with a model of its own.

    All have the `common` model until `restart` replaces one. `threads` is the number of threads that step
    them; 0: as many as there are processors.
    """

    def __init__(self, common: Compiled, n: int, threads: int = 1) -> None:
        self.n, self._common, self._threads = n, common, threads
        self._math = mathematics(n)
        self._of = [common] * n
        self._open_batch()
        self._timestep_s = float(common.mj_model.opt.timestep)
        self._substeps = round(common.model.wheel.command_period_s / self._timestep_s)
        self._limits: list[BodyLimits | None] = [None] * n
        self._any_limits = False
        self._is_free = common.mj_model.joint(0).type[0] == mujoco.mjtJoint.mjJNT_FREE

    def _open_batch(self) -> None:
        self._batch = Batch(self._common.mj_model, self.n, self._threads)
        self._qpos, self._qvel = self._batch.bind("qpos"), self._batch.bind("qvel")
        self._ctrl = self._batch.bind("ctrl")

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy or a pickle holds: the rows of MuJoCo's batch, which itself allows neither."""
        kept = {name: value for name, value in vars(self).items() if name not in _BATCH_FIELDS}
        return {**kept, "rows": self._batch.state.copy()}

    def __setstate__(self, kept: dict[str, Any]) -> None:
        """Open a new batch with the rows in `kept`."""
        rows = kept.pop("rows")
        vars(self).update(kept)
        self._open_batch()
        self._batch.set_models([one.mj_model for one in self._of])
        self._batch.state[:] = rows

    def restart(self, row: int, pose: Sequence[float], compiled: Compiled | None = None) -> None:
        """Put the robot of a row at rest at a pose x [m], y [m], yaw [rad].

        From now on it has the model `compiled`, or the common one when None.

        Raises:
            InputError: the model has other bodies or joints than the common one.
        """
        robots = [self._common if compiled is None else compiled]
        self.restart_rows(np.array([row]), np.array(pose, float)[:, None], robots)

    def restart_rows(self, rows: npt.NDArray[np.intp], poses: FloatArray, robots: Sequence[Compiled]) -> None:
        """Put the robots of some rows (m,) at rest at poses, shape (3, m), each with its model of `robots`.

        Raises:
            InputError: a model has other bodies or joints than the common one.
        """
        if any(new is not self._of[row] for row, new in zip(rows.tolist(), robots, strict=True)):
            of = list(self._of)
            for row, new in zip(rows.tolist(), robots, strict=True):
                of[row] = new
            self._take(of, rows)
        # A state at rest replaces all that a row holds, but not the warnings of a robot that diverged.
        if np.count_nonzero(self._batch.warning[rows]):
            self._batch.reset(rows.tolist(), stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        for row, pose, new in zip(rows.tolist(), poses.T, robots, strict=True):
            self._batch.state[row] = new.rest
            self._place(self._qpos[row], pose)
            self._limits[row] = self._limits_of(new)
        self._any_limits = any(limits is not None for limits in self._limits)

    def _place(self, qpos: FloatArray, pose: FloatArray) -> None:
        """Write a pose x, y, yaw, shape (3,), into the positions of one robot that is at rest."""
        x, y, yaw = pose
        if self._is_free:
            qpos[:2] = x, y
            turned, about_z = np.empty(4), np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])
            mujoco.mju_mulQuat(turned, about_z, qpos[3:7].copy())
            qpos[3:7] = turned
        else:
            qpos[:3] = x, y, yaw

    def _limits_of(self, new: Compiled) -> BodyLimits | None:
        return BodyLimits(new.model, self._timestep_s, new.link_seed) if new.limits_body else None

    def _take(self, of: list[Compiled], rows: npt.NDArray[np.intp]) -> None:
        """Give all rows the models `of`, those of `rows` being new."""
        try:
            self._batch.set_models([one.mj_model for one in of])
        except (ValueError, mujoco.FatalError) as error:
            which = f"robot {rows[0]} has" if len(rows) == 1 else f"one of robots {rows.tolist()} has"
            raise InputError(
                f"{which} other bodies or joints than the common one; give all robots the same effects, "
                f"none of them neutral: {error}"
            ) from error
        self._of = of

    def step(self, commands: FloatArray) -> None:
        """Simulate one command period with rounded commands V [rpm], theta [deg], VC [rpm], shape (n, 3).

        Raises:
            SimulationDivergedError: a state is no longer finite or plausible.
        """
        if len(commands) == 1:
            wheels = np.array([command_wheels(*commands[0].tolist())])
        else:
            wheels = command_to_wheels(commands[:, 0], commands[:, 1], commands[:, 2])
        if self._any_limits:
            control = np.repeat(wheels[:, None], self._substeps, axis=1)
            for row, limits in enumerate(self._limits):
                if limits is not None:
                    control[row] = [limits.step(wheels[row]) for _ in range(self._substeps)]
            self._batch.rollout(self._substeps, self._controls(control), record=())
        else:
            self._ctrl[:] = self._controls(wheels)
            self._batch.step(nstep=self._substeps)
        if np.count_nonzero(self._batch.warning):
            row = int(np.argmax(self._batch.warning.any(axis=(1, 2))))
            raise SimulationDivergedError(
                f"robot {row} diverged; use a shorter timestep or a less stiff servo"
            )

    def _controls(self, wheels: FloatArray) -> FloatArray:
        """Return wheel commands of the robots, shape (robots, ..., 4), as MuJoCo's controls of the rows."""
        return wheels

    def motion(self) -> FloatArray:
        """Return poses and velocities: x, y [m], yaw [rad], vx, vy [m/s], yaw rate [rad/s], shape (6, n).

        They are in the field's frame; yaw is within +-pi on the rollers and unwrapped on the planar plant.
        """
        return self._motion(self._qpos.T, self._qvel.T)

    def _motion(self, position: FloatArray, velocity: FloatArray) -> FloatArray:
        """Return what `motion` does of the generalised coordinates of one robot a row, (nq, n), (nv, n)."""
        if not self._is_free:
            return np.concatenate([position[:3], velocity[:3]])
        math = self._math
        ahead, left, _, w, x, y, z = math.of(position[:7])
        vx, vy, _, _, _, rate = math.of(velocity[:6])
        yaw = math.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        return math.table([ahead, left, yaw, vx, vy, rate])

    def qpos(self, row: int) -> FloatArray:
        """Return MuJoCo's generalised positions of the robot in a row, for drawing."""
        return np.array(self._qpos[row], float)

    def model_of(self, row: int) -> Model:
        """Return the model of the robot in a row."""
        return self._of[row].model

    def compiled_of(self, row: int) -> Compiled:
        """Return the robot in a row, ready to simulate."""
        return self._of[row]
