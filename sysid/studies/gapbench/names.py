"""The names of GapBench with their meanings and equations, as names.json and as a table of its page."""

from __future__ import annotations

import math
from typing import Any, Final

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.definition import Effect
from mecanum_env.markdown import markdown_table
from mecanum_env.model import paper_model
from sysid.studies.zoo.cases.bench.changes import CHANGES

EQUATIONS: Final = {
    "command_latency": "r(t) = u(t - delay)",
    "command_latency/jitter": "r(t) = u(t - delay - d), d random for each change, with spread jitter",
    "command_loss": "r_k = r_(k-1) with probability share, else u_k",
    "command_deadband": "r = u where |u| >= threshold, else 0",
    "command_deadband/subtract": "r = sign(u) max(|u| - threshold, 0)",
    "speed_gain": "r = gain u",
    "direction_asymmetry": "r = u where u >= 0, else reverse_ratio u",
    "battery_sag": "r = (1 - drop_per_s t) u",
    "battery_sag/voltage": "r = (1 - per_volt (V(0) - V(t))) u",
    "warm_up": "r = (1 - share (1 - exp(-t / time_constant))) u",
    "warm_up/cold_friction": "T(t) = T(warm) + (torque sign(w) + damping w) exp(-t / time_constant)",
    "static_map": "r = f(u), f monotone and piecewise linear through (knot_i, value_i)",
    "speed_saturation": "r = sign(u) min(|u|, limit); with softness a smooth knee below the limit",
    "speed_saturation/supply": "dw/dt <= (limit - w) / motor time constant while driving",
    "acceleration_limit": "|dr/dt| <= limit (braking: brake), r follows u",
    "acceleration_limit/drive": "|dw/dt| <= limit (braking: brake)",
    "acceleration_limit/s_curve": "|dr/dt| <= limit and |d2r/dt2| <= jerk, r follows u",
    "load_inertia": "dw/dt is 1/ratio of the free wheel's for the same torque",
    "backlash": "no torque between motor and wheel while the gap is crossed; the wheel runs on",
    "backlash/rest": "no torque between motor and wheel while the gap is crossed; friction slows it",
    "backlash/spring": "d2a/dt2 = (2 pi swing)^2 (m - a - friction sign(da/dt)) + 4 pi damping swing "
    "(dm/dt - da/dt) for the angles of motor m and wheel a, |m - a| <= gap / 2",
    "coulomb_friction": "w = r - droop sign(w) at steady speed, droop = torque / servo stiffness",
    "coulomb_friction/washed_out": "the same loss, decaying as exp(-t / washout) by integral action",
    "stiction": "extra friction breakaway exp(-(w / stribeck)^2), against the motion and at rest",
    "stiction/washed_out": "the same friction, overcome in time by integral action",
    "viscous_friction": "w = r - (damping / servo stiffness) w at steady speed",
    "viscous_friction/washed_out": "the same loss, decaying as exp(-t / washout) by integral action",
    "torque_ripple": "w swings as share w sin(per_turn angle + phase), or by a constant torque",
    "encoder_eccentricity": "measured = w (1 + share sin(per_turn angle + phase))",
    "sensor_latency": "measured(t) = w(t - delay)",
    "sensor_lowpass": "time_constant d(measured)/dt = w - measured",
    "sensor_lowpass/window": "measured(t) = mean of w over [t - window, t]",
    "sensor_scale": "measured = wheel w",
}
"""Effect of the catalogue -> equation: u is the command, r what the drive follows, w the wheel's speed."""


def named_effects() -> tuple[Effect, ...]:
    """Return every effect, one for each form of a cause, that a case of one wheel can hide."""
    hidden = {(change.name, change.form) for change in CHANGES}
    return tuple(e for e in CATALOGUE.values() if (e.cause, e.form) in hidden)


def names_json() -> dict[str, Any]:
    """Return the list of names as JSON objects, one for each form of a cause."""
    model = paper_model()
    return {
        "format": "gapbench-names/1",
        "effects": [
            {
                "name": effect.cause,
                "form": effect.form,
                "effect": effect.name,
                "meaning": effect.summary,
                "in_data": effect.signature,
                "equation": EQUATIONS[effect.name],
                "parameters": [
                    {"name": p.name, "unit": p.unit, "neutral": plain_number(p.neutral_in(model))}
                    for p in effect.parameters
                    if p.neutral is not None
                ],
            }
            for effect in named_effects()
        ],
    }


def plain_number(value: float) -> float | str:
    """Return a number as strict JSON can hold it: infinity becomes the text "inf"."""
    return value if math.isfinite(value) else str(value)


def names_table() -> str:
    """Return the list of names as a table in Markdown."""
    rows = [(e["name"], e["form"], e["meaning"], f"`{e['equation']}`") for e in names_json()["effects"]]
    return markdown_table(("name", "form", "meaning", "equation"), rows)
