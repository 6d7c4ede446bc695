"""A robot as the numbers that a batch computes with, from the definitions of model, effects and plant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np

from mecanum_env.effects.apply import (
    Acting,
    active_effects,
    alters_sensors,
    changed_model,
    check_effects,
    drive_parameters,
    planar_body,
    wheels_differ,
)
from mecanum_env.errors import EffectRefusedError
from mecanum_env.kinematics import WHEELS, require_mecanum
from mecanum_env.mjcf.geometry import no_slip_rows, wheels_on_body
from mecanum_env.mjcf.physics import fitting_timestep, wheel_inertia
from mecanum_env.mjcf.sideways import sideways_friction
from mecanum_env.model import Model, Robot
from mecanum_env.plugin.layout import chain_parameters
from mecanum_env.simulator.body_limits import behind_limits, limits_body
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.parameters import CHAIN, PROGRAMS
from mecanum_env.wheel_drive.program import PROGRAM_SIZE

Programs = dict[str, tuple[float, ...]]
BODY: Final = (
    *("gear_forward", "gear_left", "gear_turn"),
    *("mobility_00", "mobility_01", "mobility_02", "mobility_11", "mobility_12", "mobility_22"),
    *("is_simple", "moved_forward", "moved_left"),
    *("moment_x", "moment_y", "weight_kg", "gravity_x", "gravity_y", "damping", "damping_turn"),
    *("rub", "drag", "arm", "rest"),
)
"""Numbers of a body, in its own axes: wheel speed per velocity along each axis; the inverse of the inertia
that an implicit step moves; whether MuJoCo drops what couples the world's axes (`PlanarBatch`), and that
inertia along each axis then; mass times the offset of its centre; mass that gravity pulls; gravity along the
world's x and y; viscous friction along the axes and in turning; and the friction of the rollers, see
`mecanum_env.mjcf.sideways`."""
_QUANTUM: Final = CHAIN.index("command_quantum_rpm")
ROTOR: Final = CHAIN.index("rotor_kg_m2")
"""Where they have the inertia of the rotor."""
CHANCE: Final = [CHAIN.index(name) for name in ("jitter_s", "loss")]
"""Where drives have what makes their link random."""
_UPPER: Final = tuple((i, j) for i in range(3) for j in range(i, 3))
_NO_PROGRAMS: Final[Programs] = dict.fromkeys(PROGRAMS, (0.0,) * PROGRAM_SIZE)
"""One for all robots without custom effects: what is the same object is compared at once."""
_TIMESTEP_S: Final = 1 / 120
"""Upper bound of the physics step [s], as that of the planar plant in `mecanum_env.tankendo`."""


@dataclass(frozen=True)
class Clocks:
    """What all robots of a batch share, since they are stepped together."""

    timestep_s: float
    substeps: int
    """Physics steps in one step of the batch, a command period."""
    sample_period_s: float
    command_period_s: float
    """Period at which the robot latches its command."""
    drive_period_s: float
    """Period at which its drives latch theirs: the law's if the body's command is limited before."""


@dataclass(frozen=True, eq=False)
class PlanarRobot:
    """A model, ready for a batch."""

    source: Model | Callable[[], Model]
    """Its model, or what makes it: few of many drawn robots are ever looked at."""
    clocks: Clocks
    drives: FloatArray
    """Parameters of the drives in the order of `CHAIN`, shape (P, 4)."""
    programs: Programs
    """Programs of custom effects by the names in `PROGRAMS`."""
    body: FloatArray
    """Numbers in the order of `BODY`."""
    link: dict[str, float]
    """Delay, jitter, loss and seed of the link before limits on the body's command; empty without limits."""
    limits: dict[str, dict[str, float]]
    """Parameters of the effects that limit the body's command, by effect."""
    has_random_link: bool
    """Whether the delay of its commands jitters or commands are lost."""
    alters_sensors: bool
    """Whether effects act on what it measures of itself."""

    @cached_property
    def model(self) -> Model:
        """Its model."""
        return self.source if isinstance(self.source, Model) else self.source()

    def with_link_seed(self, seed: int) -> PlanarRobot:
        """Return the same robot with other chance of its link, from 0 to `wheel_drive.link.MOST_SEEDS`."""
        drives = self.drives.copy()
        drives[CHAIN.index("link_seed")] = seed
        link = {**self.link, "link_seed": float(seed)} if self.link else {}
        return replace(self, drives=drives, link=link)


def planar_robot(model: Model, timestep_s: float | None = None) -> PlanarRobot:
    """Return a model's numbers for a batch of robots without slip.

    `timestep_s` is the upper bound of the physics step [s], by default 1/120 s.

    Raises:
        EffectRefusedError: an effect that the planar plant refuses, or that has no form for batches.
        InputError: any other model that the planar plant cannot simulate.
    """
    require_mecanum(model.robot, "the batched plant is")
    check_effects(model, "planar")
    _require_forms(model)
    limited = limits_body(model)
    after = changed_model(behind_limits(model), "planar")
    timestep = fitting_timestep(after, _TIMESTEP_S if timestep_s is None else timestep_s)
    period = model.wheel.command_period_s
    rows = _drive_rows(after)
    drives = rows[: len(CHAIN)].copy()
    # V, theta and VC are rounded before the kinematics.
    drives[_QUANTUM] = 0.0
    link = {}
    if limited:
        before = drive_parameters(model)
        names = ("delay_s", "jitter_s", "loss", "link_seed")
        link = {name: float(getattr(before, name)) for name in names}
    return PlanarRobot(
        model,
        Clocks(
            timestep,
            round(period / timestep),
            model.wheel.law.sample_period_s,
            period,
            after.wheel.command_period_s,
        ),
        drives,
        _programs_in(rows[len(CHAIN) :, 0]),
        body_numbers(
            after.robot,
            active_effects(after),
            timestep,
            wheel_inertia(after.robot) + float(drives[ROTOR, 0]),
        )[:, 0],
        link,
        {effect.name: values for effect, values in active_effects(model) if effect.limit_bodies is not None},
        bool(np.count_nonzero(drives[CHANCE])) or any(link.get(name, 0.0) for name in ("jitter_s", "loss")),
        alters_sensors(model),
    )


def _require_forms(model: Model) -> None:
    for effect, _ in active_effects(model):
        if not effect.acts_in("planar"):
            continue
        lacks_spec = effect.change_spec is not None and effect.change_planar is None
        if lacks_spec or (effect.limit_body is not None and effect.limit_bodies is None):
            raise EffectRefusedError(
                f"effects.{effect.name}: has no form for batches of arrays (change_planar or limit_bodies in "
                "its definition); simulate it in MuJoCo, or remove it from the model file"
            )


def _drive_rows(model: Model) -> FloatArray:
    """Return the parameters and programs of the four drives, shape (P, 4)."""
    inertia = wheel_inertia(model.robot)
    differ = wheels_differ(model)
    wheels = WHEELS if differ else (None,)
    rows = [chain_parameters(model, wheel, inertia_kg_m2=inertia) for wheel in wheels]
    return np.array(rows if differ else rows * len(WHEELS)).T


def _programs_in(numbers: FloatArray) -> Programs:
    """Return the programs of custom effects, one after the other in `numbers`, by the names in `PROGRAMS`."""
    if not np.count_nonzero(numbers):
        return _NO_PROGRAMS
    programs = np.split(numbers, len(PROGRAMS))
    return {name: tuple(program.tolist()) for name, program in zip(PROGRAMS, programs, strict=True)}


def body_numbers(robot: Robot, acting: Acting, timestep_s: float, wheel_kg_m2: float) -> FloatArray:
    """Return what `BODY` lists of a robot on which effects are `acting`.

    `wheel_kg_m2` is the inertia of a wheel and its rotor. All numbers may be arrays (m,), those of m robots.
    The shape is (23, m), with m = 1 for floats.
    """
    body = planar_body(robot, acting)
    rows = no_slip_rows(robot)
    armature, armature_turn = wheels_on_body(robot, wheel_kg_m2)
    damping, damping_turn = wheels_on_body(robot, body.wheel_damping_n_m_s_rad)
    weight = body.mass_kg + body.middle_mass_kg
    x, y = body.mass_kg * body.com_x_m, body.mass_kg * body.com_y_m
    turning = body.yaw_inertia_kg_m2 + x * body.com_x_m + y * body.com_y_m + body.middle_yaw_inertia_kg_m2
    moved = weight + armature
    inertia = _matrices(moved, 0.0, -y, 0.0, moved, x, -y, x, turning + armature_turn)
    brakes = _matrices(damping, 0.0, 0.0, 0.0, damping, 0.0, 0.0, 0.0, damping_turn)
    servo = np.reshape(robot.servo_n_m_s_rad, (-1, 1, 1)) * rows.T @ rows
    moving = inertia + timestep_s * (brakes + servo)
    mobility = np.linalg.inv(moving)
    is_simple = (x == 0.0) & (y == 0.0) & (body.middle_mass_kg == 0.0)
    # The wheel fr turns forward by each of the three motions: its row has the sizes of all.
    gravity = body.gravity_m_s2[:2]
    return table_of(
        [
            *rows[WHEELS.index("fr")],
            *(mobility[:, i, j] for i, j in _UPPER),
            *(is_simple, moving[:, 0, 0], moving[:, 1, 1]),
            *(x, y, weight, *gravity, damping, damping_turn),
            *sideways_friction(robot, body, timestep_s),
        ]
    )


def table_of(numbers: Sequence[Any]) -> FloatArray:
    """Return `numbers` as an array (k, m), floats repeated beside arrays (m,); without arrays m is 1."""
    m = next((len(number) for number in numbers if isinstance(number, np.ndarray)), 1)
    table = np.empty((len(numbers), m))
    for row, number in zip(table, numbers, strict=True):
        row[:] = number
    return table


def _matrices(*numbers: Any) -> FloatArray:
    """Return the matrix (3, 3) that has nine `numbers` row by row, of each of m robots: (m, 3, 3)."""
    return table_of(numbers).T.reshape(-1, 3, 3)
