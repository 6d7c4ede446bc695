"""`model.json`: the identified wheel, the robot around it, the effects found, and where it all came from.

The file is the contract between fit, simulator, environment and gap workflow (format "mecanum-model/1").
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Final

from mecanum_env.asset_files import asset_path
from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.files import write_json
from mecanum_env.law.coefficients import COEFFICIENTS, WheelLaw

FORMAT: Final = "mecanum-model/1"

EFFECT_PARAMETERS: Final[Mapping[str, tuple[str, ...]]] = {
    "command_latency": ("delay_s",),
    "command_deadband": ("threshold_rpm",),
    "body_speed_limit": ("v_rpm", "vc_rpm"),
    "body_acceleration_limit": ("v_rpm_s", "vc_rpm_s"),
    "speed_gain": ("gain",),
    "wheel_gain_mismatch": ("gain_fl", "gain_fr", "gain_rl", "gain_rr"),
    "direction_asymmetry": ("reverse_ratio",),
    "speed_saturation": ("limit_rpm", "softness_rpm"),
    "acceleration_limit": ("limit_rpm_s",),
    "battery_sag": ("drop_per_s", "per_volt"),
    "coulomb_friction": ("torque_n_m",),
    "stiction": ("breakaway_n_m", "stribeck_rpm"),
    "viscous_friction": ("damping_n_m_s_rad",),
    "backlash": ("gap_deg",),
    "weak_servo": ("servo_n_m_s_rad",),
    "payload": ("mass_kg", "height_m"),
    "com_offset": ("x_m", "y_m"),
    "roller_friction": ("torque_n_m", "damping_n_m_s_rad"),
    "low_grip": ("friction",),
    "wheel_radius": ("scale",),
    "track_width": ("scale",),
    "mount_yaw": ("angle_deg",),
    "floor_slope": ("slope_deg", "heading_deg"),
    "sensor_latency": ("delay_s",),
    "sensor_lowpass": ("time_constant_s",),
    "sensor_scale": ("wheel", "linear", "yaw"),
    "sensor_bias": ("vx_m_s", "vy_m_s", "yaw_rate_rad_s"),
}
"""Names a model file may use under "effects", with their parameters."""


@dataclass(frozen=True)
class Wheel:
    """The identified wheel: its law and what happens to a command before it."""

    law: WheelLaw
    command_period_s: float = 0.1
    """The robot latches its command this often [s]."""
    command_quantum_rpm: float = 1.0
    """Commands are rounded to multiples of this [rpm]; 0: not rounded."""
    saturation_rpm: float = 135.0
    """Wheel commands are clipped to +- this [rpm]; infinite (null in the file): no limit was seen."""

    def __post_init__(self) -> None:
        _require("wheel.command_period_s", self.command_period_s, 0.0, strict=True)
        _require("wheel.command_quantum_rpm", self.command_quantum_rpm, 0.0)
        _require("wheel.saturation_rpm", self.saturation_rpm, 0.0, strict=True, finite=False)


@dataclass(frozen=True)
class Robot:
    """The robot around the wheels.

    The defaults are this project's own: the paper does not print dimensions, mass, servo or friction in its
    text. A ruler, a scale and `python -m sysid.fit --robot FILE` replace them.
    """

    wheel_radius_m: float = 0.0762
    half_wheelbase_m: float = 0.18
    half_track_m: float = 0.20
    mass_kg: float = 20.0
    """All of it, wheels and rollers included."""
    yaw_inertia_kg_m2: float = 0.9
    """All of it, about the vertical through the centre."""
    rollers_per_wheel: int = 10
    servo_n_m_s_rad: float = 5.0
    """Torque per wheel-speed error [N m s/rad]: how stiffly the drive holds the law's speed under load."""
    servo_integral_n_m_rad: float = 0.0
    """Torque per integrated speed error [N m/rad]; above 0 friction leaves no steady-state loss."""
    torque_limit_n_m: float = 6.0
    friction: float = 0.8
    """Coulomb coefficient between roller and floor."""

    def __post_init__(self) -> None:
        for name in ("wheel_radius_m", "half_wheelbase_m", "half_track_m", "mass_kg", "yaw_inertia_kg_m2"):
            _require(f"robot.{name}", getattr(self, name), 0.0, strict=True)
        for name in ("servo_n_m_s_rad", "torque_limit_n_m", "friction"):
            _require(f"robot.{name}", getattr(self, name), 0.0, strict=True)
        _require("robot.servo_integral_n_m_rad", self.servo_integral_n_m_rad, 0.0)
        if self.rollers_per_wheel != int(self.rollers_per_wheel) or not 4 <= self.rollers_per_wheel <= 24:
            raise InputError(
                f"robot.rollers_per_wheel = {self.rollers_per_wheel}, must be a whole number 4..24"
            )


@dataclass(frozen=True)
class Model:
    """Everything a simulator needs to know; see the package README for the file format."""

    wheel: Wheel
    robot: Robot = field(default_factory=Robot)
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    uncertainty: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    extra: Mapping[str, Any] = field(default_factory=dict)
    """Top-level fields of the file that this version does not know; kept on writing."""

    def __post_init__(self) -> None:
        for name, parameters in self.effects.items():
            if name not in EFFECT_PARAMETERS:
                raise InputError(
                    f"effects.{name}: no such effect{did_you_mean(name, EFFECT_PARAMETERS)}; "
                    f"known: {', '.join(EFFECT_PARAMETERS)}"
                )
            for key, value in parameters.items():
                known = EFFECT_PARAMETERS[name]
                if key not in known:
                    raise InputError(f"effects.{name}.{key}: no such parameter; known: {', '.join(known)}")
                _require(f"effects.{name}.{key}", value, -math.inf, finite=False)

    def with_effect(self, name: str, **parameters: float) -> Model:
        """Return a copy with one effect added or replaced."""
        return replace(self, effects={**self.effects, name: parameters})


def read_model(path: str | os.PathLike[str]) -> Model:
    """Read a `model.json`.

    Raises:
        InputError: no such file, not JSON, another format, a missing, unknown, non-finite or impossible value.
        UnstableLawError: the wheel law is unstable; the message lists the poles.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); make a model with `python -m sysid.fit LOGS`"
        ) from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a text file; a model is JSON as `python -m sysid.fit` writes") from error
    try:
        value = json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(f"{path}, line {error.lineno}: not valid JSON ({error.msg})") from error
    try:
        return model_from_dict(value)
    except InputError as error:
        raise type(error)(f"{path}: {error}") from error


def write_model(model: Model, path: str | os.PathLike[str]) -> None:
    """Write a `model.json` in full double precision, whole or not at all; `read_model` gives it back equal."""
    write_json(path, model_to_dict(model))


def paper_model() -> Model:
    """Return the packaged model of the paper (coefficients renormalised; sample period inferred)."""
    return read_model(asset_path("models/paper.json"))


def model_to_dict(model: Model) -> dict[str, Any]:
    """Return the JSON object of a model."""
    wheel = model.wheel
    return {
        "format": FORMAT,
        "wheel": {
            **{name: getattr(wheel.law, name) for name in COEFFICIENTS},
            "sample_period_s": wheel.law.sample_period_s,
            **{name: _infinite_as_null(getattr(wheel, name)) for name in _WHEEL_FIELDS},
        },
        "robot": {f.name: getattr(model.robot, f.name) for f in fields(Robot)},
        "effects": {
            name: {key: _infinite_as_null(value) for key, value in parameters.items()}
            for name, parameters in model.effects.items()
        },
        "uncertainty": dict(model.uncertainty),
        "provenance": dict(model.provenance),
        **model.extra,
    }


def model_from_dict(value: Any) -> Model:
    """Build a model from a JSON object; the messages name the field.

    Raises:
        InputError: a missing, unknown, non-finite or impossible value.
        UnstableLawError: the wheel law is unstable.
    """
    top = _mapping("the file", value)
    if top.get("format") != FORMAT:
        raise InputError(f'"format" is {top.get("format")!r}, must be "{FORMAT}"')
    if "wheel" not in top:
        raise InputError('"wheel" is missing; it holds A..F and sample_period_s')
    wheel = _numbers("wheel", top["wheel"], (*COEFFICIENTS, "sample_period_s", *_WHEEL_FIELDS))
    missing = [name for name in (*COEFFICIENTS, "sample_period_s") if name not in wheel]
    if missing:
        raise InputError(f'"wheel" lacks {", ".join(missing)}')
    law = WheelLaw(**{name: wheel.pop(name) for name in (*COEFFICIENTS, "sample_period_s")}).require_stable()
    known = ("format", "wheel", "robot", "effects", "uncertainty", "provenance")
    return Model(
        wheel=Wheel(law, **wheel),
        robot=robot_from_dict(top.get("robot", {})),
        effects={
            name: _numbers(f"effects.{name}", parameters, EFFECT_PARAMETERS.get(name, ()), null=math.inf)
            if name in EFFECT_PARAMETERS
            else dict(_mapping(f"effects.{name}", parameters))
            for name, parameters in _mapping("effects", top.get("effects", {})).items()
        },
        uncertainty=dict(_mapping("uncertainty", top.get("uncertainty", {}))),
        provenance=dict(_mapping("provenance", top.get("provenance", {}))),
        extra={name: item for name, item in top.items() if name not in known},
    )


def robot_from_dict(value: Any) -> Robot:
    """Build the robot from a partial JSON object; packaged values fill in what is absent.

    Raises:
        InputError: an unknown name, or a value out of range.
    """
    numbers: dict[str, Any] = _numbers("robot", value, tuple(f.name for f in fields(Robot)))
    rollers = numbers.get("rollers_per_wheel")
    if rollers is not None and float(rollers).is_integer():
        numbers["rollers_per_wheel"] = int(rollers)
    return Robot(**numbers)


_WHEEL_FIELDS: Final = ("command_period_s", "command_quantum_rpm", "saturation_rpm")


def _mapping(where: str, value: Any) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{where} must be a JSON object, not {type(value).__name__}")
    return value


def _numbers(where: str, value: Any, known: tuple[str, ...], null: float = math.inf) -> dict[str, float]:
    numbers: dict[str, float] = {}
    for name, number in _mapping(where, value).items():
        if name not in known:
            raise InputError(
                f"{where}.{name}: unknown name{did_you_mean(name, known)}; known: {', '.join(known)}"
            )
        if number is None:
            numbers[name] = null
        elif isinstance(number, bool) or not isinstance(number, int | float):
            raise InputError(f"{where}.{name} = {number!r}, must be a number")
        else:
            numbers[name] = float(number)
    return numbers


def _require(
    name: str, value: float, low: float, *, strict: bool = False, finite: bool = True
) -> None:
    """Raise `InputError` unless `value` is a number at or above (`strict`: above) `low`."""
    bad = math.isnan(value) or (finite and math.isinf(value)) or value < low or (strict and value == low)
    if bad:
        bound = f"above {low:g}" if strict else f"at least {low:g}"
        kind = "a finite number" if finite else "a number"
        raise InputError(f"{name} = {value}, must be {kind} {bound}" if low > -math.inf else
                         f"{name} = {value}, must be {kind}")


def _infinite_as_null(value: float) -> float | None:
    return None if math.isinf(value) else value
