"""What an effect is: its parameters, its traces in data, and the functions that put it into a simulation.

One `Effect` says everything about an effect; simulator, gap search, controllers, certificates and
documentation read it from there. An effect with none of the functions at its end is known but not simulated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, Literal

from mecanum_env.effects.scale import Scale
from mecanum_env.model import Model
from mecanum_env.model.effect_names import cause_of
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.drive import DriveParameters

if TYPE_CHECKING:
    import mujoco

PlantKind = Literal["bench", "rollers", "planar"]
"""Simulated system: one free wheel; the robot on its rollers; the robot that slides without slip."""
RobotPlant = Literal["rollers", "planar"]
"""The plants that are the whole robot."""
PLANTS: Final[tuple[PlantKind, ...]] = ("bench", "rollers", "planar")
Station = Literal["command", "body_command", "set_point", "law", "load", "transmission", "body", "sensor"]
"""Where on the way from command to log an effect acts: path and timing of the command; limits on V, theta and
VC; each wheel's setpoint; how the wheel follows it; what loads the drive; motor to wheel; robot and floor;
measurement."""
Remedy = Literal["command", "observation", "prediction"]
"""How a controller can undo an effect: by other commands, by corrected observations, by predicting ahead."""

Values = Mapping[str, float]
"""Parameter name -> value."""
Channels = Mapping[str, FloatArray]
"""Column of a log -> its samples on the physics clock, shape (n,)."""


@dataclass(frozen=True)
class Parameter:
    """One number of an effect."""

    name: str
    """Name in the model file, with the unit."""
    unit: str
    neutral: float | str | None
    """Value at which the effect changes nothing; a string names a number of the model ("robot.friction").
    None: the parameter only matters beside another one, as the height of a payload does."""
    bounds: tuple[float, float]
    """Range of a search on the reference drive of `mecanum_env.effects.scale`; see `scaled`."""
    valid: tuple[float, float] = (0.0, math.inf)
    """Range that the simulator accepts, both ends included; infinity itself only where it is neutral."""
    default: float = 0.0
    """Value if the model file leaves the parameter out and `neutral` is None."""
    scan: tuple[float, ...] | None = None
    """Values to try one by one, if the response has no useful gradient (thresholds)."""
    stepwise: bool = False
    """The response jumps where the value passes a command, and is flat in between."""
    searched: bool = True
    """False: a search leaves it at its neutral or default value."""
    multiples: tuple[float, ...] = ()
    """Multiples of the effect's first parameter, which has the same bounds, at which a search tries this one;
    otherwise it is left at the `default`."""
    follows_rise: bool = True
    """Whether a rate follows the time in which the drive rises; one of the host's commands does not."""
    relative: bool = False
    """`bounds` and `scan` are shares of what the drive can give, see `Scale.factor`."""
    largest: Callable[[Model], float] | None = None
    """Largest value that a simulation of the given model can represent, if that is below `bounds`."""

    def neutral_in(self, model: Model) -> float:
        """Return the value that means "no effect" in a model: `neutral`, the model's own, or `default`."""
        if self.neutral is None:
            return self.default
        if isinstance(self.neutral, str):
            section, field = self.neutral.split(".")
            return float(getattr(getattr(model, section), field))
        return self.neutral

    def scaled(self, scale: Scale) -> Parameter:
        """Return the parameter as a search needs it on a drive of this `scale`; `valid` stays."""
        if self.stepwise and scale.thresholds_rpm:
            # Commands may be beyond the speed that the drive reaches.
            most = max(scale.top_rpm, *scale.thresholds_rpm)
            return replace(self, bounds=(self.bounds[0], most), scan=scale.thresholds_rpm)
        unit = self.unit if self.follows_rise else "rpm"
        factor = scale.factor(unit, relative=self.relative)
        if factor == 1.0:
            return self
        low, high = self.bounds
        scan = None if self.scan is None else tuple(factor * value for value in self.scan)
        bounds = max(self.valid[0], factor * low), factor * high
        return replace(self, bounds=bounds, scan=scan, relative=False)


@dataclass(frozen=True)
class PlanarBody:
    """Mass, damping and gravity of the planar plant (`mecanum_env.mjcf.planar_spec`), wheels not included.

    It says what effects change of a robot without slip, without MuJoCo.
    """

    mass_kg: float
    """Mass of the base."""
    yaw_inertia_kg_m2: float
    """Its moment about its centre of mass."""
    com_x_m: float = 0.0
    com_y_m: float = 0.0
    """Its centre of mass, ahead of the middle of the wheels and to the left."""
    middle_mass_kg: float = 0.0
    """Further mass in the middle of the wheels."""
    middle_yaw_inertia_kg_m2: float = 0.0
    wheel_damping_n_m_s_rad: float = 0.0
    """Viscous friction of each wheel."""
    roller_coulomb_n_m: float = 0.0
    roller_damping_n_m_s_rad: float = 0.0
    """Friction in the bearing of the roller on the floor of each wheel, constant and viscous."""
    gravity_m_s2: tuple[float, float, float] = (0.0, 0.0, -9.81)
    """Gravity in the world's axes, MuJoCo's own on a level floor."""


@dataclass(frozen=True)
class Load:
    """What effects add to the robot's mass and to the friction of each wheel."""

    mass_kg: float = 0.0
    coulomb_n_m: float = 0.0
    damping_n_m_s_rad: float = 0.0

    def __add__(self, other: Load) -> Load:
        return Load(
            self.mass_kg + other.mass_kg,
            self.coulomb_n_m + other.coulomb_n_m,
            self.damping_n_m_s_rad + other.damping_n_m_s_rad,
        )


ChangeModel = Callable[[Model, Values], Model]
"""Return the model with other numbers in its sections."""
ChangeSpec = Callable[["mujoco.MjSpec", Values, Model, PlantKind], None]
"""Change the finished MuJoCo spec of a plant in place; the `Model` is the one it was generated from."""
ChangeDrive = Callable[[DriveParameters, Values, str | None], DriveParameters]
"""Return the changed drive of a wheel (fl .. rr, or None for the common one)."""
BodyCommand = tuple[float, float, float]
"""Command of the robot as a whole: forward, left, turn [rpm]."""
LimitBody = Callable[[BodyCommand, BodyCommand, Values, float], tuple[BodyCommand, BodyCommand]]
"""Return the limited body command after some time [s], and its mean over that time, given the requested and
the previous one."""
ChangePlanar = Callable[[PlanarBody, Values], PlanarBody]
"""Return the changed numbers of the planar plant's body: what `change_spec` does there, without MuJoCo."""
LimitBodies = Callable[[Any, Any, Mapping[str, Any], float], tuple[Any, Any]]
"""The same as `LimitBody` for many robots: commands (3, n), and arrays (n,) of the parameters by name."""
ChangeChannels = Callable[[FloatArray, Channels, Values], dict[str, FloatArray]]
"""Return the channels as measured, given their true values and the uniform clock [s], shape (n,), whose 0 is
the start of the motion."""


@dataclass(frozen=True, kw_only=True)
class Effect:
    """A named departure from the ideal robot."""

    name: str
    """Its cause, followed by "/" and the form for all but the first form of a cause ("backlash/spring")."""
    station: Station
    acts_on: str
    """The part it acts on, in words."""
    parameters: tuple[Parameter, ...]
    summary: str
    """What it is, one line."""
    signature: str
    """What it looks like in data, one line."""
    first_form: str = ""
    """What the first form of a cause with several forms is called; "" for the others and for single ones."""
    direct_check: str = ""
    """What to measure to see it without a model, as the object of "measure ..."; empty: nothing is known."""
    realistic: Callable[[Model], Values] | None = None
    """Size that a robot in use may well have, for certificates; None: certificates leave the effect out."""

    absent_from: tuple[PlantKind, ...] = ()
    """Plants without the part it acts on, where it rightly changes nothing (a payload on the bench)."""
    refused_by: tuple[PlantKind, ...] = ()
    """Plants that have the part but cannot express the effect: they refuse the model."""
    understated_by: tuple[PlantKind, ...] = ()
    """Plants that simulate only part of it, since the rest comes from how rollers bear on the floor."""
    reads: tuple[str, ...] = ()
    """Columns of a log that it follows; without them in the logs nothing shows it."""
    vector: tuple[str, str] | None = None
    """Names of a size and of its angle [deg]. A search takes both as a vector, since the angle of nothing is
    arbitrary."""
    search_from: Callable[[Scale], Values] | None = None
    """For an effect that changes nothing at many places: values of parameters at which a search starts."""
    unsearched_on: tuple[PlantKind, ...] = ()
    """Plants on whose logs a search for the effects that a model lacks leaves it out."""
    needs_falling_command: bool = False
    """Whether the bench shows it only where a command falls or reverses within a run: at the first start
    alone, a gap in which a wheel may stand anywhere is no other than a delay of any length."""
    shifts_time: bool = False
    """It moves everything behind it later, so that responses measured without it no longer hold."""
    exact: bool = False
    """It is a factor, a delay or an angle, for which there is only one formula; friction and limits take
    forms that differ from drive to drive."""
    bench_twins: tuple[str, ...] = ()
    """Effects that no bench log separates from this one, even side by side: only the product shows."""

    undone_by: Remedy | None = None
    """How a compensating controller undoes it; None: it is left alone."""
    restore_channels: ChangeChannels | None = None
    """Inverse of `change_channels`, if it needs only the present sample."""
    load: Callable[[Values], Load] | None = None
    """Its part of mass and wheel friction, for predictions and inverses without MuJoCo."""
    turned: Callable[[Values, float], Values] | None = None
    """For an effect with a direction in the world: its values in axes turned by some yaw [rad]."""

    change_model: ChangeModel | None = None
    """If the effect has one of the next two functions as well, this one must be idempotent."""
    change_spec: ChangeSpec | None = None
    change_drive: ChangeDrive | None = None
    limit_body: LimitBody | None = None
    change_planar: ChangePlanar | None = None
    """Needed beside `change_spec` for `mecanum_env.batch`, which refuses the effect without it."""
    limit_bodies: LimitBodies | None = None
    """Needed beside `limit_body`, likewise."""
    change_channels: ChangeChannels | None = None
    damps_joint: bool = False
    """Whether all that `change_spec` does on the bench is to damp the joint as the drive's load says, so that
    the wheel can be simulated without MuJoCo."""

    @property
    def cause(self) -> str:
        """The physical cause, which a verdict names."""
        return cause_of(self.name)

    @property
    def form(self) -> str:
        """The form that the cause takes; "" if it has one only."""
        return self.name.partition("/")[2] or self.first_form

    @property
    def follows_angle(self) -> bool:
        """Whether it swings with the wheel's angle, with a phase that differs from run to run."""
        return any(parameter.name == "phase_deg" for parameter in self.parameters)

    @property
    def changes_motion(self) -> bool:
        """Whether it changes what happens, and not only what is measured of it."""
        functions = (self.change_model, self.change_spec, self.change_drive, self.limit_body)
        return any(function is not None for function in functions)

    @property
    def only_in_drive(self) -> bool:
        """Whether nothing but the wheel's drive changes, in no run otherwise than in another."""
        elsewhere = (self.change_model, self.change_spec, self.limit_body, self.change_channels)
        return self.change_drive is not None and not any(elsewhere) and not self.follows_angle

    @property
    def simulated(self) -> bool:
        """Whether any plant simulates it."""
        return self.changes_motion or self.change_channels is not None

    def acts_in(self, plant: PlantKind) -> bool:
        """Return whether it changes anything on the plant."""
        return self.simulated and plant not in (*self.absent_from, *self.refused_by)

    def readable_in(self, columns: Collection[str]) -> bool:
        """Return whether logs with these `columns` have all that it follows."""
        return all(name in columns for name in self.reads)

    def searched_in(self, plant: PlantKind) -> bool:
        """Return whether a search on logs of the plant tries it."""
        return self.acts_in(plant) and plant not in self.unsearched_on

    def fully_in(self, plant: PlantKind) -> bool:
        """Return whether a plant simulates all that it changes there."""
        return plant not in (*self.refused_by, *self.understated_by)

    def complete(self, values: Values, model: Model) -> dict[str, float]:
        """Return all parameters; what the `values` of a model file leave out is neutral in the model."""
        return {p.name: values.get(p.name, p.neutral_in(model)) for p in self.parameters}

    def is_neutral(self, values: Values, model: Model) -> bool:
        """Return whether the values change nothing in a model."""
        return self.acting(values, model) is None

    def acting(self, values: Values, model: Model) -> dict[str, float] | None:
        """Return what `complete` does; None if the values change nothing in the model."""
        full = self.complete(values, model)
        for one in self.parameters:
            if one.neutral is not None and full[one.name] != one.neutral_in(model):
                return full
        return None


def usual_ceiling_rpm(model: Model) -> float:
    """Return the model's saturation [rpm], at most 135 rpm (the packaged robot's), to derive sizes from."""
    return min(model.wheel.saturation_rpm, 135.0)
