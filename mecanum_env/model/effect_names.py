"""The names of effects, their forms and parameters that a model may hold: the contract of docs/effects.md.

What an effect does is defined in `mecanum_env.effects`. An effect is called by its cause ("backlash"). A
cause that takes several forms has one effect for each: the first is called by the cause alone, the others by
cause and form ("backlash/spring"). A model has one form of a cause.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.wheel_drive.set_point import MAP_PARAMETERS

_SCHEMA: Final[dict[str, tuple[str, ...]]] = {
    "command_latency": ("delay_s",),
    "command_latency/jitter": ("delay_s", "jitter_s"),
    "command_loss": ("share",),
    "body_speed_limit": ("v_rpm", "vc_rpm"),
    "body_acceleration_limit": ("v_rpm_s", "vc_rpm_s"),
    "command_deadband": ("threshold_rpm",),
    "command_deadband/subtract": ("threshold_rpm",),
    "speed_gain": ("gain",),
    "wheel_gain_mismatch": ("gain_fl", "gain_fr", "gain_rl", "gain_rr"),
    "direction_asymmetry": ("reverse_ratio",),
    "battery_sag": ("drop_per_s", "per_volt"),
    "battery_sag/voltage": ("per_volt",),
    "warm_up": ("share", "time_constant_s"),
    "warm_up/friction": ("share", "time_constant_s"),
    "warm_up/cold": ("share", "time_constant_s"),
    "static_map": MAP_PARAMETERS,
    "speed_saturation": ("limit_rpm", "softness_rpm"),
    "speed_saturation/supply": ("limit_rpm", "motor_s", "per_volt", "windup"),
    "acceleration_limit": ("limit_rpm_s", "brake_rpm_s"),
    "acceleration_limit/drive": ("limit_rpm_s", "brake_rpm_s", "windup"),
    "acceleration_limit/s_curve": ("limit_rpm_s", "jerk_rpm_s2", "brake_rpm_s"),
    "load_inertia": ("ratio",),
    "load_inertia/integral": ("ratio",),
    "weak_servo": ("servo_n_m_s_rad",),
    "backlash": ("gap_deg",),
    "backlash/rest": ("gap_deg", "slowing_rpm_s"),
    "backlash/spring": ("gap_deg", "swing_hz", "damping", "friction_deg"),
    "coulomb_friction": ("torque_n_m", "answer_s"),
    "coulomb_friction/washed_out": ("torque_n_m", "answer_s", "washout_s"),
    "stiction": ("breakaway_n_m", "stribeck_rpm", "answer_s"),
    "stiction/washed_out": ("breakaway_n_m", "stribeck_rpm", "answer_s", "washout_s"),
    "viscous_friction": ("damping_n_m_s_rad", "answer_s"),
    "viscous_friction/washed_out": ("damping_n_m_s_rad", "answer_s", "washout_s"),
    "warm_up/cold_friction": ("torque_n_m", "damping_n_m_s_rad", "time_constant_s"),
    "torque_ripple": ("per_turn", "share", "torque_n_m", "phase_deg"),
    "torque_ripple/washed_out": ("per_turn", "share", "torque_n_m", "phase_deg", "answer_s", "washout_s"),
    "roller_friction": ("torque_n_m", "damping_n_m_s_rad"),
    "low_grip": ("friction",),
    "payload": ("mass_kg", "height_m"),
    "com_offset": ("x_m", "y_m"),
    "wheel_radius": ("scale",),
    "track_width": ("scale",),
    "floor_slope": ("slope_deg", "heading_deg"),
    "mount_yaw": ("angle_deg",),
    **{f"mount_yaw/{form}": ("angle_deg",) for form in ("body", "pose")},
    "encoder_eccentricity": ("per_turn", "share", "phase_deg"),
    "sensor_latency": ("delay_s",),
    **{f"sensor_latency/{form}": ("delay_s",) for form in ("wheels", "body", "pose")},
    "sensor_lowpass": ("time_constant_s",),
    "sensor_lowpass/window": ("window_s",),
    "sensor_scale": ("wheel", "linear", "yaw"),
    "sensor_bias": ("vx_m_s", "vy_m_s", "yaw_rate_rad_s"),
    "sensor_bias/drift": ("vx_m_s", "vy_m_s", "yaw_rate_rad_s", "per_s"),
}

EFFECT_PARAMETERS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(_SCHEMA)
"""Effect -> names of its parameters, in the order of the chain; a live view of what is known now."""

_FIRST_FORMS: Final[dict[str, str]] = {
    "command_latency": "fixed",
    "command_loss": "drop",
    "command_deadband": "drop",
    "battery_sag": "time",
    "warm_up": "gain",
    "static_map": "curve",
    "speed_saturation": "clip",
    "acceleration_limit": "set_point",
    "backlash": "coast",
    "coulomb_friction": "droop",
    "stiction": "droop",
    "viscous_friction": "droop",
    "torque_ripple": "load",
    "sensor_latency": "all",
    "sensor_lowpass": "lag",
    "mount_yaw": "all",
    "encoder_eccentricity": "sensor",
    "sensor_bias": "constant",
}
"""Cause -> what its first form is called, for causes with several forms."""


def cause_of(effect: str) -> str:
    """Return the physical cause that an effect's name begins with."""
    return effect.partition("/")[0]


def form_of(effect: str) -> str:
    """Return the form that a cause takes in an effect; "" for a cause with one form only."""
    cause, _, form = effect.partition("/")
    return form or _FIRST_FORMS.get(cause, "")


def forms_of(cause: str) -> tuple[str, ...]:
    """Return the effects that are forms of a cause, the first form first."""
    return tuple(effect for effect in EFFECT_PARAMETERS if cause_of(effect) == cause)


def effect_named(cause: str, form: str | None = None) -> str:
    """Return the effect that a cause in some form is, by default in its first form.

    Raises:
        InputError: the cause does not take this form. An unknown cause is returned as it is.
    """
    first = _FIRST_FORMS.get(cause, "")
    if form is None or not forms_of(cause) or form == first != "":
        return cause
    effect = f"{cause}/{form}"
    if effect not in _SCHEMA:
        known = ", ".join(filter(None, map(form_of, forms_of(cause)))) or "none, leave it out"
        raise InputError(f"effects.{cause}.form = {form!r}: no such form; known: {known}")
    return effect


def add_to_schema(
    name: str, parameters: tuple[str, ...], after: str | None = None, first_form: str = ""
) -> None:
    """Let model files hold one more effect, with these parameters; use `mecanum_env.effects.register`.

    It acts behind the effect `after`; None puts it at the end of the chain. `first_form` is what the effect
    is called among the forms of its cause.

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
    if first_form:
        _FIRST_FORMS[name] = first_form


def remove_from_schema(name: str) -> None:
    """Forget an effect that `add_to_schema` added under this name."""
    del _SCHEMA[name]
    _FIRST_FORMS.pop(name, None)
