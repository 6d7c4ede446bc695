"""The list of bench cases: what is hidden, how much, in which drive."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sysid.studies.blind.cases import Case, Kind, Size

from .recipes import Fields, Recipe, Truth, drawn, factor

Maker = Callable[[np.random.Generator, bool], tuple[Fields, Truth]]
"""From random numbers, and whether the effect is to be clear, to hidden fields and the truth in our terms."""

ANY = ("droop", "integral", "pid")
LOADED = ("droop", "integral")
TWINS = {
    "command_latency": ("sensor_latency",),
    "sensor_latency": ("command_latency",),
    "speed_gain": ("sensor_scale",),
    "sensor_scale": ("speed_gain",),
}


def _late(rng: np.random.Generator, clear: bool) -> float:
    return round(drawn(rng, 0.035, 0.08) if clear else drawn(rng, 0.003, 0.006), 3)


def _command_latency(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    seconds = _late(rng, clear)
    return {"command_late_s": seconds}, {"command_latency": {"delay_s": seconds}}


def _sensor_latency(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    seconds = _late(rng, clear)
    return {"log_late_s": seconds}, {"sensor_latency": {"delay_s": seconds}}


def _speed_gain(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    gain = factor(rng, 0.06, 0.12) if clear else factor(rng, 0.015, 0.025)
    return {"wrong_ratio": gain}, {"speed_gain": {"gain": gain}}


def _sensor_scale(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    scale = factor(rng, 0.06, 0.12) if clear else factor(rng, 0.015, 0.025)
    return {"log_factor": scale}, {"sensor_scale": {"wheel": scale}}


def _deadband(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    # Between whole commands, so that it is well defined.
    threshold = float(rng.integers(9, 17) if clear else rng.integers(3, 6)) + 0.5
    return {"ignored_below_rpm": threshold}, {"command_deadband": {"threshold_rpm": threshold}}


def _asymmetry(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    ratio = factor(rng, 0.07, 0.13) if clear else factor(rng, 0.02, 0.03)
    return {"weak_reverse": ratio}, {"direction_asymmetry": {"reverse_ratio": ratio}}


def _saturation(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    limit = drawn(rng, 60.0, 85.0) if clear else drawn(rng, 102.0, 108.0)
    return {"top_rpm": limit}, {"speed_saturation": {"limit_rpm": limit}}


def _acceleration(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    limit = drawn(rng, 250.0, 500.0) if clear else drawn(rng, 3000.0, 4500.0)
    return {"ramp_rpm_s": limit}, {"acceleration_limit": {"limit_rpm_s": limit}}


def _sag(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    drop = drawn(rng, 0.025, 0.045) if clear else drawn(rng, 0.006, 0.01)
    return {"supply_fall_per_s": drop}, {"battery_sag": {"drop_per_s": drop}}


def _coulomb(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    torque = drawn(rng, 0.3, 0.6) if clear else drawn(rng, 0.08, 0.12)
    return {"drag_n_m": torque}, {"coulomb_friction": {"torque_n_m": torque}}


def _stiction(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    torque, speed = drawn(rng, 0.35, 0.6) if clear else drawn(rng, 0.1, 0.15), drawn(rng, 5.0, 12.0)
    return (
        {"sticking_n_m": torque, "sticking_rpm": speed},
        {"stiction": {"breakaway_n_m": torque, "stribeck_rpm": speed}},
    )


def _viscous(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    damping = drawn(rng, 0.06, 0.12) if clear else drawn(rng, 0.015, 0.025)
    return {"oil_n_m_s": damping}, {"viscous_friction": {"damping_n_m_s_rad": damping}}


def _backlash(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    gap = drawn(rng, 4.0, 9.0) if clear else drawn(rng, 1.0, 1.8)
    return {"play_deg": gap}, {"backlash": {"gap_deg": gap}}


def _lowpass(rng: np.random.Generator, clear: bool) -> tuple[Fields, Truth]:
    seconds = drawn(rng, 0.03, 0.07) if clear else drawn(rng, 0.004, 0.007)
    return {"log_filter_s": seconds}, {"sensor_lowpass": {"time_constant_s": seconds}}


MAKERS: dict[str, tuple[Maker, tuple[str, ...]]] = {
    "command_deadband": (_deadband, ANY),
    "direction_asymmetry": (_asymmetry, ANY),
    "speed_saturation": (_saturation, ANY),
    "acceleration_limit": (_acceleration, ANY),
    "battery_sag": (_sag, ANY),
    "coulomb_friction": (_coulomb, LOADED),
    "stiction": (_stiction, LOADED),
    "viscous_friction": (_viscous, ("droop",)),
    "backlash": (_backlash, LOADED),
    "sensor_lowpass": (_lowpass, ANY),
    "command_latency": (_command_latency, ANY),
    "sensor_latency": (_sensor_latency, ANY),
    "speed_gain": (_speed_gain, ANY),
    "sensor_scale": (_sensor_scale, ANY),
}
"""Effect -> how it is hidden, and in which drives. Friction leaves next to nothing in the plain PID's, and
a viscous one none where there is an integral."""

PAIRS = (
    ("command_deadband", "backlash"),
    ("coulomb_friction", "acceleration_limit"),
    ("direction_asymmetry", "sensor_lowpass"),
    ("speed_saturation", "battery_sag"),
    ("coulomb_friction", "backlash"),
    ("viscous_friction", "command_deadband"),
    ("acceleration_limit", "direction_asymmetry"),
    ("speed_saturation", "command_deadband"),
    ("battery_sag", "backlash"),
    ("stiction", "direction_asymmetry"),
    ("sensor_lowpass", "speed_saturation"),
    ("coulomb_friction", "battery_sag"),
    ("command_latency", "speed_saturation"),
    ("speed_gain", "acceleration_limit"),
)

OUTSIDE: dict[str, Callable[[np.random.Generator], Fields]] = {
    "eccentric code wheel": lambda rng: {"ripple": drawn(rng, 0.04, 0.08)},
    "cogging": lambda rng: {"cogging_n_m": drawn(rng, 0.3, 0.5)},
    "swinging torque": lambda rng: {"shaking_n_m": drawn(rng, 0.3, 0.5)},
    "lost commands": lambda rng: {"lost_commands": drawn(rng, 0.15, 0.25)},
    "rising gain": lambda rng: {"rising_gain": drawn(rng, 0.15, 0.25)},
    "slower, overshooting loop": lambda rng: {"slower_loop": drawn(rng, 2.2, 3.0)},
    "warming up": lambda rng: {"warming": drawn(rng, 0.08, 0.15)},
    "glitches": lambda rng: {"glitch_share": drawn(rng, 0.02, 0.04)},
    "hysteresis of the gain": lambda rng: {"hysteresis": drawn(rng, 0.06, 0.12)},
    "offset of the command": lambda rng: {"offset_rpm": drawn(rng, 2.0, 4.0)},
    "coarse commands": lambda rng: {"coarse_rpm": float(rng.integers(9, 15))},
    "swinging gain": lambda rng: {"swing": drawn(rng, 0.05, 0.1)},
}
"""What no effect of the catalogue is; what it is -> how it is hidden. Torques need a drive that yields."""

UNREPEATABLE = ("lost commands", "glitches")
"""Different in each repeat, hence part of what the logs give as noise."""

UNTESTABLE: dict[str, tuple[Fields, dict[str, float]]] = {
    "speed_saturation": ({"top_rpm": 90.0}, {"limit_rpm": 90.0}),
    "command_deadband": ({"ignored_below_rpm": 12.5}, {"threshold_rpm": 12.5}),
    "direction_asymmetry": ({"weak_reverse": 0.8}, {"reverse_ratio": 0.8}),
}
"""There, but the gentle commands (forward, 30 to 70 rpm) do not show it."""


def recipes(seed: int) -> list[Recipe]:
    """Return the bench cases of a seed."""
    made: list[Recipe] = []
    sizes: tuple[Size, ...] = ("clear", "small")
    for name in MAKERS:
        kind = "twin" if name in TWINS else "single"
        for size in sizes:
            for number in range(1, 4):
                made.append(_hidden(seed, kind, size, (name,), number))
    for pair in PAIRS:
        made += [_hidden(seed, "pair", "clear", pair, number) for number in (1, 2)]
    for number in range(1, 46):
        case = Case(f"bench-none-{number:02d}", "bench", "none", "-", ANY[number % 3], ())
        made.append(Recipe(case, {}))
    for what, maker in OUTSIDE.items():
        for number in range(1, 3 if what in UNREPEATABLE else 5):
            label = what.replace(",", "").replace(" ", "_")
            name = f"bench-outside-{label}-{number}"
            rng = np.random.default_rng([seed, 3, list(OUTSIDE).index(what), number])
            plants = ("droop",) if what in ("cogging", "swinging torque") else ANY
            case = Case(name, "bench", "outside", "clear", plants[number % len(plants)], (what,))
            made.append(Recipe(case, maker(rng)))
    for name, (fields, true) in UNTESTABLE.items():
        for number in range(1, 4):
            label = f"bench-untestable-{name}-{number}"
            case = Case(label, "bench", "untestable", "clear", ANY[number % 3], (name,), {name: true})
            made.append(Recipe(case, dict(fields), gentle=True))
    return made


def _hidden(seed: int, kind: Kind, size: Size, names: tuple[str, ...], number: int) -> Recipe:
    index = list(MAKERS).index(names[0])
    rng = np.random.default_rng([seed, 1 if len(names) == 1 else 2, index, size == "clear", number])
    fields: Fields = {}
    truth: dict[str, dict[str, float]] = {}
    for name in names:
        more, true = MAKERS[name][0](rng, size == "clear")
        fields |= more
        truth |= {effect: dict(values) for effect, values in true.items()}
    plants = [p for p in ANY if all(p in MAKERS[name][1] for name in names)]
    twins = tuple(twin for name in names for twin in TWINS.get(name, ()))
    label = f"bench-{kind}-{'-'.join(names)}-{size}-{number}"
    return Recipe(
        Case(label, "bench", kind, size, plants[number % len(plants)], names, truth, twins),
        fields,
    )
