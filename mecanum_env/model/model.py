"""The data of a model: the identified wheel, the robot around it, its effects, and where they come from.

The names of effects and parameters that a model may hold are the contract of docs/effects.md; what an effect
does is defined in `mecanum_env.effects`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Final

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.kinematics import WHEELS
from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.law.drive import DriveParameters

_SCHEMA: Final[dict[str, tuple[str, ...]]] = {
    "command_latency": ("delay_s",),
    "body_speed_limit": ("v_rpm", "vc_rpm"),
    "body_acceleration_limit": ("v_rpm_s", "vc_rpm_s"),
    "command_deadband": ("threshold_rpm",),
    "speed_gain": ("gain",),
    "wheel_gain_mismatch": ("gain_fl", "gain_fr", "gain_rl", "gain_rr"),
    "direction_asymmetry": ("reverse_ratio",),
    "battery_sag": ("drop_per_s", "per_volt"),
    "speed_saturation": ("limit_rpm", "softness_rpm"),
    "acceleration_limit": ("limit_rpm_s",),
    "weak_servo": ("servo_n_m_s_rad",),
    "backlash": ("gap_deg",),
    "coulomb_friction": ("torque_n_m",),
    "stiction": ("breakaway_n_m", "stribeck_rpm"),
    "viscous_friction": ("damping_n_m_s_rad",),
    "roller_friction": ("torque_n_m", "damping_n_m_s_rad"),
    "low_grip": ("friction",),
    "payload": ("mass_kg", "height_m"),
    "com_offset": ("x_m", "y_m"),
    "wheel_radius": ("scale",),
    "track_width": ("scale",),
    "floor_slope": ("slope_deg", "heading_deg"),
    "mount_yaw": ("angle_deg",),
    "sensor_latency": ("delay_s",),
    "sensor_lowpass": ("time_constant_s",),
    "sensor_scale": ("wheel", "linear", "yaw"),
    "sensor_bias": ("vx_m_s", "vy_m_s", "yaw_rate_rad_s"),
}

EFFECT_PARAMETERS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(_SCHEMA)
"""Effect -> names of its parameters, in the order of the chain; a live view of what is known now."""


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

    def __post_init__(self) -> None:
        _require("wheel.command_period_s", self.command_period_s, 0.0, strict=True)
        _require("wheel.command_quantum_rpm", self.command_quantum_rpm, 0.0)
        _require("wheel.saturation_rpm", self.saturation_rpm, 0.0, strict=True, finite=False)

    def drive_parameters(self) -> DriveParameters:
        """Return the drive of this wheel without any effect."""
        return DriveParameters(self.law, self.command_period_s, self.command_quantum_rpm, self.saturation_rpm)


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
    torque_limit_n_m: float = 1.5
    """Largest torque of a drive on its wheel [N m].

    1.5 is the most that starts this robot on this floor without a wheel spinning: it takes 28 N along the
    roller, and the axle that the start unloads can hold 29 N. The paper's law asks for 10 N m at its steepest
    (a step to 130 rpm), but more torque gives wheelspin instead of speed, and a path that depends on the time
    step. The free wheel needs 0.8 N m.
    """
    friction: float = 0.8
    """Coulomb coefficient between roller and floor."""

    @property
    def plate_yaw_inertia_kg_m2(self) -> float:
        """Yaw inertia of a solid plate with the robot's mass, wheelbase and track: m (a^2 + b^2) / 3."""
        return self.mass_kg * (self.half_wheelbase_m**2 + self.half_track_m**2) / 3.0

    def __post_init__(self) -> None:
        positive = ("wheel_radius_m", "half_wheelbase_m", "half_track_m", "mass_kg", "yaw_inertia_kg_m2")
        for name in (*positive, "servo_n_m_s_rad", "torque_limit_n_m", "friction"):
            _require(f"robot.{name}", getattr(self, name), 0.0, strict=True)
        _require("robot.servo_integral_n_m_rad", self.servo_integral_n_m_rad, 0.0)
        if not 4 <= self.rollers_per_wheel <= 24 or self.rollers_per_wheel != int(self.rollers_per_wheel):
            raise InputError(
                f"robot.rollers_per_wheel = {self.rollers_per_wheel}, must be a whole number 4..24"
            )


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

    def __post_init__(self) -> None:
        for name, parameters in self.effects.items():
            if name not in EFFECT_PARAMETERS:
                raise InputError(
                    f"effects.{name}: no such effect{did_you_mean(name, EFFECT_PARAMETERS)}; "
                    f"known: {', '.join(EFFECT_PARAMETERS)}"
                )
            known = EFFECT_PARAMETERS[name]
            for key, value in parameters.items():
                if key not in known:
                    raise InputError(f"effects.{name}.{key}: no such parameter; known: {', '.join(known)}")
                _require(f"effects.{name}.{key}", value, -math.inf, strict=True, finite=False)
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

    def with_effect(self, name: str, **parameters: float) -> Model:
        """Return a copy in which the effect `name` is added or replaced, with these `parameters`.

        Raises:
            InputError: no effect or parameter has that name, or a value is not a number.
        """
        return replace(self, effects={**self.effects, name: parameters})


def _require_wheel(where: str, name: str) -> None:
    if name not in WHEELS:
        raise InputError(f"{where}: no such wheel; known: {', '.join(WHEELS)}")


def _require(name: str, value: float, low: float, *, strict: bool = False, finite: bool = True) -> None:
    """Raise `InputError` unless `value` is a number at or above (`strict`: above) `low`."""
    if math.isnan(value) or (finite and math.isinf(value)) or value < low or (strict and value == low):
        kind = "a finite number" if finite else "a number"
        bound = "" if low == -math.inf else f" above {low:g}" if strict else f" at least {low:g}"
        raise InputError(f"{name} = {value}, must be {kind}{bound}")


def add_to_schema(name: str, parameters: tuple[str, ...], after: str | None = None) -> None:
    """Let model files hold one more effect, with these parameters; use `mecanum_env.effects.register`.

    It acts behind the effect `after`; None puts it at the end of the chain.

    Raises:
        InputError: the name is taken, or `after` is not known.
    """
    if name in _SCHEMA:
        raise InputError(f"effect {name}: this name is taken; choose another one")
    if after is not None and after not in _SCHEMA:
        raise InputError(
            f"effect {name}: after = {after!r} is no effect{did_you_mean(after, _SCHEMA)}; "
            f"known: {', '.join(_SCHEMA)}"
        )
    entries = list(_SCHEMA.items())
    place = len(entries) if after is None else list(_SCHEMA).index(after) + 1
    entries.insert(place, (name, parameters))
    _SCHEMA.clear()
    _SCHEMA.update(entries)


def remove_from_schema(name: str) -> None:
    """Forget an effect that `add_to_schema` added under this name."""
    del _SCHEMA[name]
