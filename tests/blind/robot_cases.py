"""The list of robot cases: what is hidden, and how much."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sysid.studies.blind.cases import Case, Kind, Size

from .recipes import Fields, Recipe, Truth, drawn, factor

Maker = Callable[[np.random.Generator, bool], tuple[Fields, Truth]]
PLANT, DRIVEN = "lifted", "driven"
"""Whose model was fitted off the floor, and on it."""
TICK_S = 1 / 120
"""A command acts at the next tick of the law, so whole ticks are what a delay can be."""


def _plain(
    effect: str,
    parameter: str,
    field: str,
    clear: tuple[float, float],
    small: tuple[float, float],
) -> Maker:
    """Return the maker of an effect with one parameter, drawn from a range for each size."""

    def make(rng: np.random.Generator, is_clear: bool) -> tuple[Fields, Truth]:
        value = drawn(rng, *(clear if is_clear else small))
        return {field: value}, {effect: {parameter: value}}

    return make


def _factor(
    effect: str,
    parameters: tuple[str, ...],
    fields: tuple[str, ...],
    clear: tuple[float, float],
    small: tuple[float, float],
) -> Maker:
    """Return the maker of an effect whose parameters are near 1, the same value in all fields."""

    def make(rng: np.random.Generator, is_clear: bool) -> tuple[Fields, Truth]:
        value = factor(rng, *(clear if is_clear else small))
        return dict.fromkeys(fields, value), {effect: dict.fromkeys(parameters, value)}

    return make


def _command_latency(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    seconds = TICK_S * int(rng.integers(5, 10) if clear else 1)
    return {"late_s": seconds}, {"command_latency": {"delay_s": seconds}}


def _payload(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    mass = drawn(rng, 8.0, 15.0) if clear else drawn(rng, 1.5, 3.0)
    return {"load_kg": mass, "load_height_m": 0.2}, {"payload": {"mass_kg": mass}}


def _com(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    x, y = (0.05 * np.array([rng.choice([-1, 1]), rng.choice([-1, 1])]) * (1.0 if clear else 0.3)).tolist()
    return {"com_x_m": x, "com_y_m": y}, {"com_offset": {"x_m": x, "y_m": y}}


def _slope(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    slope, heading = drawn(rng, 5.0, 9.0) if clear else drawn(rng, 1.0, 2.0), drawn(rng, -170.0, 170.0)
    return (
        {"slope_deg": slope, "downhill_deg": heading},
        {"floor_slope": {"slope_deg": slope, "heading_deg": heading}},
    )


def _weak_motor(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    which = int(rng.integers(4))
    share = drawn(rng, 0.85, 0.93) if clear else drawn(rng, 0.97, 0.98)
    gains = {f"gain_{wheel}": 1.0 for wheel in ("fl", "fr", "rl", "rr")}
    gains[list(gains)[which]] = share
    return {"weak_motor": float(which), "weak_share": share}, {"wheel_gain_mismatch": gains}


def _speed_limit(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    v, vc = (drawn(rng, 35.0, 50.0), drawn(rng, 15.0, 25.0)) if clear else (drawn(rng, 75.0, 85.0), 40.0)
    return {"v_top": v, "vc_top": vc}, {"body_speed_limit": {"v_rpm": v, "vc_rpm": vc}}


def _body_ramp(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    v, vc = (200.0, 100.0) if clear else (900.0, 500.0)
    v, vc = v * drawn(rng, 0.8, 1.2), vc * drawn(rng, 0.8, 1.2)
    return {"v_ramp": v, "vc_ramp": vc}, {"body_acceleration_limit": {"v_rpm_s": v, "vc_rpm_s": vc}}


def _deadband(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    threshold = float(rng.integers(10, 16) if clear else rng.integers(3, 6)) + 0.5
    return {"ignored_below_rpm": threshold}, {"command_deadband": {"threshold_rpm": threshold}}


def _bias(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    size = 1.0 if clear else 0.2
    vx, vy, yaw = (size * rng.choice([-1.0, 1.0], 3) * [0.03, 0.02, 0.06]).tolist()
    return (
        {"vx_offset": vx, "vy_offset": vy, "yaw_offset": yaw},
        {"sensor_bias": {"vx_m_s": vx, "vy_m_s": vy, "yaw_rate_rad_s": yaw}},
    )


_LARGE, _LITTLE = (0.06, 0.12), (0.015, 0.025)
MAKERS: dict[str, Maker] = {
    "command_latency": _command_latency,
    "body_speed_limit": _speed_limit,
    "body_acceleration_limit": _body_ramp,
    "command_deadband": _deadband,
    "speed_gain": _factor("speed_gain", ("gain",), ("all_motors",), _LARGE, _LITTLE),
    "wheel_gain_mismatch": _weak_motor,
    "direction_asymmetry": _factor("direction_asymmetry", ("reverse_ratio",), ("reverse",), _LARGE, _LITTLE),
    "speed_saturation": _plain("speed_saturation", "limit_rpm", "wheel_top", (50.0, 70.0), (88.0, 94.0)),
    "acceleration_limit": _plain(
        "acceleration_limit", "limit_rpm_s", "wheel_ramp", (200.0, 400.0), (1500.0, 2500.0)
    ),
    "battery_sag": _plain("battery_sag", "drop_per_s", "fall_per_s", (0.025, 0.045), (0.006, 0.01)),
    "weak_servo": _plain("weak_servo", "servo_n_m_s_rad", "stiffness", (0.8, 1.5), (3.3, 3.8)),
    "coulomb_friction": _plain("coulomb_friction", "torque_n_m", "wheel_drag_n_m", (0.4, 0.7), (0.1, 0.15)),
    "viscous_friction": _plain(
        "viscous_friction", "damping_n_m_s_rad", "wheel_oil_n_m_s", (0.2, 0.35), (0.04, 0.06)
    ),
    "roller_friction": _plain("roller_friction", "torque_n_m", "roller_drag_n_m", (0.06, 0.12), (0.02, 0.03)),
    "low_grip": _plain("low_grip", "friction", "grip", (0.08, 0.16), (0.3, 0.35)),
    "payload": _payload,
    "com_offset": _com,
    "wheel_radius": _factor("wheel_radius", ("scale",), ("radius",), _LARGE, _LITTLE),
    "track_width": _factor("track_width", ("scale",), ("arms",), (0.08, 0.15), (0.02, 0.03)),
    "floor_slope": _slope,
    "mount_yaw": _plain("mount_yaw", "angle_deg", "turned_deg", (5.0, 12.0), (1.0, 2.0)),
    "sensor_latency": _plain("sensor_latency", "delay_s", "log_late_s", (0.04, 0.08), (0.005, 0.01)),
    "sensor_lowpass": _plain(
        "sensor_lowpass", "time_constant_s", "log_filter_s", (0.03, 0.07), (0.006, 0.01)
    ),
    "sensor_scale": _factor("sensor_scale", ("yaw",), ("yaw_factor",), _LARGE, _LITTLE),
    "sensor_bias": _bias,
}
SMALL = ("speed_gain", "mount_yaw", "sensor_latency", "payload", "coulomb_friction", "roller_friction")
PAIRS = (
    ("coulomb_friction", "mount_yaw"),
    ("command_latency", "speed_saturation"),
    ("roller_friction", "wheel_gain_mismatch"),
    ("battery_sag", "sensor_bias"),
    ("body_acceleration_limit", "track_width"),
    ("command_deadband", "sensor_latency"),
)
ON_DRIVEN = ("speed_saturation", "viscous_friction", "mount_yaw", "payload")
"""Alone, they are looked for with the model that was fitted to robot logs."""
OUTSIDE: dict[str, Fields] = {
    "sensor off the centre": {"lever_m": 0.12},
    "rollers of one wheel blocked": {"blocked_rollers": 0.02},
    "rising gain": {"rising_gain": 0.2},
    "warming up": {"warming": 0.12},
    "wind": {"wind_n": 25.0},
    "crosstalk": {"crosstalk": 0.6},
}
UNTESTABLE: dict[str, tuple[Fields, dict[str, float]]] = {
    "track_width": ({"arms": 1.15}, {"scale": 1.15}),
    "roller_friction": ({"roller_drag_n_m": 0.02}, {"torque_n_m": 0.02}),
}


def recipes(seed: int) -> list[Recipe]:
    """Return the robot cases of a seed."""
    made = [_hidden(seed, "single", "clear", (name,)) for name in MAKERS]
    made += [_hidden(seed, "single", "small", (name,)) for name in SMALL]
    made += [_hidden(seed, "pair", "clear", pair) for pair in PAIRS]
    for number in range(1, 13):
        plant = DRIVEN if number % 3 == 0 else PLANT
        made.append(Recipe(Case(f"robot-none-{number:02d}", "robot", "none", "-", plant, ()), {}))
    for what, fields in OUTSIDE.items():
        name = f"robot-outside-{what.replace(' ', '_')}"
        made.append(Recipe(Case(name, "robot", "outside", "clear", PLANT, (what,)), dict(fields)))
    for effect, (fields, true) in UNTESTABLE.items():
        name = f"robot-untestable-{effect}"
        case = Case(name, "robot", "untestable", "clear", PLANT, (effect,), {effect: true})
        made.append(Recipe(case, dict(fields), gentle=True))
    return made


def _hidden(seed: int, kind: Kind, size: Size, names: tuple[str, ...]) -> Recipe:
    fields: Fields = {}
    truth: dict[str, dict[str, float]] = {}
    for name in names:
        key = [seed, 4, list(MAKERS).index(name), len(names), size == "clear"]
        more, true = MAKERS[name](np.random.default_rng(key), size == "clear")
        fields |= more
        truth |= {effect: dict(values) for effect, values in true.items()}
    label = f"robot-{kind}-{'-'.join(names)}-{size}"
    plant = DRIVEN if names[0] in ON_DRIVEN and len(names) == 1 else PLANT
    return Recipe(Case(label, "robot", kind, size, plant, names, truth), fields)
