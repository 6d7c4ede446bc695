"""The data of a model: the identified wheel, the robot around it, its effects, and where they come from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.kinematics import WHEELS
from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.model.custom import STATIONS, CustomEffect, program_at
from mecanum_env.model.effect_names import EFFECT_PARAMETERS, cause_of, effect_named
from mecanum_env.omni import OmniWheel, require_all_motions
from mecanum_env.wheel_drive.drive import DriveParameters


@dataclass(frozen=True)
class Wheel:
    """The identified wheel law and the processing of a command in front of it."""

    law: WheelLaw
    command_period_s: float = 0.1
    """Period at which the robot latches its command [s]."""
    command_quantum_rpm: float = 1.0
    """Commands are rounded to multiples of this [rpm]; 0: not rounded."""
    saturation_rpm: float = 135.0
    """Wheel commands are clipped to +- this [rpm]; infinite (null in the file): no limit was seen."""
    windup: float = 0.0
    """Share of what the law asks beyond the bounds of its motor that it asks for again in the next tick: 0
    with anti-windup, 1 in a controller whose integral goes on, which overshoots after every large step."""

    def __post_init__(self) -> None:
        _require("wheel.command_period_s", self.command_period_s, 0.0, strict=True)
        _require("wheel.command_quantum_rpm", self.command_quantum_rpm, 0.0)
        _require("wheel.saturation_rpm", self.saturation_rpm, 0.0, strict=True, finite=False)
        _require_share("wheel.windup", self.windup)

    def drive_parameters(self) -> DriveParameters:
        """Return the drive of this wheel without any effect."""
        return DriveParameters(
            self.law,
            self.command_period_s,
            self.command_quantum_rpm,
            self.saturation_rpm,
            windup=self.windup,
        )


@dataclass(frozen=True)
class Robot:
    """The robot around the wheels.

    The defaults are this project's own: the paper's text prints no dimensions, mass, servo or friction.
    Replace them by measurements with `python -m sysid.fit LOGS --robot FILE`.
    """

    wheel_radius_m: float = 0.0762
    half_wheelbase_m: float = 0.18
    half_track_m: float = 0.20
    mass_kg: float = 20.0
    """Total mass, wheels and rollers included."""
    yaw_inertia_kg_m2: float = 0.9
    """Total moment of inertia about the vertical axis through the centre."""
    rollers_per_wheel: int = 10
    servo_n_m_s_rad: float = 5.0
    """Torque per wheel-speed error [N m s/rad]: how stiffly the drive holds the law's speed under load."""
    servo_integral_n_m_rad: float = 0.0
    """Torque per integrated speed error [N m/rad]; above 0 friction leaves no steady-state loss."""
    servo_windup: float = 0.0
    """Share of the speed error that the integral takes up while the torque is limited: 0 where it then stands
    still, 1 in a controller without anti-windup, which overshoots after every large step."""
    torque_limit_n_m: float = 1.5
    """Largest torque of a drive on its wheel [N m].

    1.5 is the most that starts this robot on this floor without a wheel spinning: it takes 28 N along the
    roller, and the axle that the start unloads can hold 29 N. The paper's law asks for 10 N m at its steepest
    (a step to 130 rpm), but more torque gives wheelspin instead of speed, and a path that depends on the time
    step. The free wheel needs 0.8 N m.
    """
    friction: float = 0.8
    """Coulomb coefficient between roller and floor."""
    wheels: tuple[OmniWheel, ...] = ()
    """The wheels of a robot on other omni wheels than the four Mecanum wheels of these dimensions; else
    empty. The plants in MuJoCo and the commands V, theta, VC are of the Mecanum robot and refuse it."""

    @property
    def plate_yaw_inertia_kg_m2(self) -> float:
        """Yaw inertia of a solid plate with the robot's mass, wheelbase and track: m (a^2 + b^2) / 3."""
        return self.mass_kg * (self.half_wheelbase_m**2 + self.half_track_m**2) / 3.0

    def __post_init__(self) -> None:
        positive = ("wheel_radius_m", "half_wheelbase_m", "half_track_m", "mass_kg", "yaw_inertia_kg_m2")
        for name in (*positive, "servo_n_m_s_rad", "torque_limit_n_m", "friction"):
            _require(f"robot.{name}", getattr(self, name), 0.0, strict=True)
        _require("robot.servo_integral_n_m_rad", self.servo_integral_n_m_rad, 0.0)
        _require_share("robot.servo_windup", self.servo_windup)
        if not 4 <= self.rollers_per_wheel <= 24 or self.rollers_per_wheel != int(self.rollers_per_wheel):
            raise InputError(
                f"robot.rollers_per_wheel = {self.rollers_per_wheel}, must be a whole number 4..24"
            )
        if self.wheels:
            require_all_motions(self.wheels)


ROBOT_NUMBERS: Final = tuple(one.name for one in fields(Robot) if one.name != "wheels")
"""Names of the robot's numbers, in the order of the file."""


@dataclass(frozen=True)
class Model:
    """Everything that a simulator needs; the fields are the sections of the file.

    Raises:
        InputError: an effect, parameter or wheel that does not exist, or a value that is not a number.
    """

    wheel: Wheel
    robot: Robot = field(default_factory=Robot)
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    uncertainty: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    extra: Mapping[str, Any] = field(default_factory=dict)
    """Unknown fields of the file, which are written back: top-level ones by their name, those inside a
    section under "wheel" and "robot"."""
    wheels: Mapping[str, WheelLaw] = field(default_factory=dict)
    """Laws of single wheels (fl, fr, rl, rr) that differ from `wheel.law`; see `law_of`."""
    custom: tuple[CustomEffect, ...] = ()
    """Effects without a name; they act on every wheel alike."""

    def __post_init__(self) -> None:
        causes: set[str] = set()
        for name, parameters in self.effects.items():
            if name not in EFFECT_PARAMETERS:
                raise InputError(
                    f"effects.{name}: no such effect{did_you_mean(name, EFFECT_PARAMETERS)}; "
                    f"known: {', '.join(EFFECT_PARAMETERS)}"
                )
            cause = cause_of(name)
            if cause in causes:
                raise InputError(f"effects.{cause}: given in two forms; a model has one of them")
            causes.add(cause)
            known = EFFECT_PARAMETERS[name]
            for key, value in parameters.items():
                if key not in known:
                    raise InputError(f"effects.{name}.{key}: no such parameter; known: {', '.join(known)}")
                _require(f"effects.{name}.{key}", value, -math.inf, strict=True, finite=False)
        if self.custom:
            for station in STATIONS:
                program_at(self.custom, station)
        for name, law in self.wheels.items():
            _require_wheel(f"wheels.{name}", name)
            if law.sample_period_s != self.wheel.law.sample_period_s:
                raise InputError(
                    f"wheels.{name}: sample_period_s = {law.sample_period_s}, must be that of the common "
                    f"law, {self.wheel.law.sample_period_s}; see mecanum_env.law.conversion"
                )

    def law_of(self, wheel_name: str) -> WheelLaw:
        """Return the law of one wheel: its own if `wheels` has one, else the common one.

        Raises:
            InputError: `wheel_name` is not fl, fr, rl or rr.
        """
        _require_wheel(wheel_name, wheel_name)
        return self.wheels.get(wheel_name, self.wheel.law)

    def with_effect(self, name: str, form: str | None = None, /, **parameters: float) -> Model:
        """Return a copy in which the effect `name` is added or replaced, with these `parameters`.

        The cause `name` acts in the given `form`, by default its first. It replaces any other form of it.

        Raises:
            InputError: no effect, form or parameter has that name, or a value is not a number.
        """
        effect = name if form is None else effect_named(name, form)
        others = {kept: v for kept, v in self.effects.items() if cause_of(kept) != cause_of(effect)}
        if effect in self.effects:
            others = dict(self.effects)
        return replace(self, effects={**others, effect: parameters})

    def with_custom(self, *effects: CustomEffect) -> Model:
        """Return a copy to which custom `effects` are added.

        Raises:
            InputError: all those of a station together are too long.
        """
        return replace(self, custom=(*self.custom, *effects))


def _require_wheel(where: str, name: str) -> None:
    if name not in WHEELS:
        raise InputError(f"{where}: no such wheel; known: {', '.join(WHEELS)}")


def _require_share(name: str, value: float) -> None:
    if not 0.0 <= value <= 1.0:
        raise InputError(f"{name} = {value}, must be a number from 0 to 1")


def _require(name: str, value: float, low: float, *, strict: bool = False, finite: bool = True) -> None:
    """Raise `InputError` unless `value` is a number at or above (`strict`: above) `low`."""
    if math.isnan(value) or (finite and math.isinf(value)) or value < low or (strict and value == low):
        kind = "a finite number" if finite else "a number"
        bound = "" if low == -math.inf else f" above {low:g}" if strict else f" at least {low:g}"
        raise InputError(f"{name} = {value}, must be {kind}{bound}")
