"""Names and parameters of the effects that a model file may hold, in the order in which they act.

This is the plain contract (docs/effects.md); what an effect does is defined in `mecanum_env.effects`.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from mecanum_env.errors import InputError, did_you_mean

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


def add_to_schema(name: str, parameters: tuple[str, ...], after: str | None = None) -> None:
    """Let model files hold one more effect; use `mecanum_env.effects.register`, which calls this.

    Args:
        name: new name of the effect.
        parameters: names of its parameters.
        after: known effect behind which it acts; None puts it at the end of the chain.

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
