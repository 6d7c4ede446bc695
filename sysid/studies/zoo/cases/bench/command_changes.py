"""Changes on the way from the command to the drive's set-point: the link and the map of the firmware."""

from __future__ import annotations

from typing import Final

import numpy as np

from sysid.studies.zoo.cases.bench.change import (
    Change,
    Parameters,
    always,
    no_truth,
    sign,
    with_controller,
    with_link,
)
from sysid.studies.zoo.drives.drive import Drive

Rng = np.random.Generator


# --- the link ---


def _later(drive: Drive, strength: float, _rng: Rng) -> Drive:
    return with_link(drive, delay_s=drive.link.delay_s + 0.4 * strength)


def _jitter(drive: Drive, strength: float, _rng: Rng) -> Drive:
    """Let the delay vary; its mean rises with the spread, because no message is early."""
    link, spread = drive.link, 0.2 * strength
    return with_link(drive, delay_s=link.delay_s + 1.5 * spread, jitter_s=link.jitter_s + spread)


def _jitter_truth(before: Drive, after: Drive) -> Parameters:
    return {"delay_s": after.link.delay_s - before.link.delay_s, "jitter_s": after.link.jitter_s}


def _loss(drive: Drive, strength: float, _rng: Rng) -> Drive:
    return with_link(drive, loss=drive.link.loss + (0.9 - drive.link.loss) * strength)


# --- what the firmware makes of a command ---


def _no_dead_zone(drive: Drive) -> bool:
    return drive.controller.dead_zone_rpm == 0.0


def _drops(drive: Drive, strength: float, _rng: Rng) -> Drive:
    return with_controller(drive, dead_zone_rpm=0.6 * drive.top_rpm * strength, dead_zone="drop")


def _subtracts(drive: Drive, strength: float, _rng: Rng) -> Drive:
    return with_controller(drive, dead_zone_rpm=0.4 * drive.top_rpm * strength, dead_zone="subtract")


def _gain(drive: Drive, strength: float, rng: Rng) -> Drive:
    return with_controller(drive, gain=drive.controller.gain * (1.0 + 0.4 * strength * sign(rng)))


def _reverse(drive: Drive, strength: float, rng: Rng) -> Drive:
    ratio = 1.0 + 0.4 * strength * sign(rng)
    return with_controller(drive, reverse_gain=drive.controller.reverse_gain * ratio)


def _straight(drive: Drive) -> bool:
    return not drive.controller.curve_rpm and drive.controller.offset_rpm == 0.0


def _curve(drive: Drive, strength: float, rng: Rng) -> Drive:
    """Bend the map between zero and the top speed, both ways, or move it as a whole (one draw in four)."""
    moved, direction = rng.random() < 0.25, sign(rng)
    inner = np.sort(rng.uniform(0.1, 0.9, int(rng.integers(2, 5))))
    waves = rng.uniform(1.0, 2.0)
    if moved:
        return with_controller(drive, offset_rpm=direction * 0.3 * drive.top_rpm * strength)
    x = np.concatenate(([0.0], inner, [1.0]))
    # A wave of this amplitude alone would just stay monotone; the ends stay where they are.
    bend = direction * np.sin(np.pi * waves * x) * x * (1.0 - x)
    steepest = float(np.max(-np.diff(bend) / np.maximum(np.diff(x), 1e-9)))
    y = x + strength * 0.95 / max(steepest, 0.5) * bend
    points = zip(x[1:] * drive.top_rpm, y[1:] * drive.top_rpm, strict=True)
    return with_controller(drive, curve_rpm=tuple((float(a), float(b)) for a, b in points))


COMMAND_CHANGES: Final = (
    Change(
        "command_latency",
        "fixed",
        always,
        _later,
        lambda before, after: {"delay_s": after.link.delay_s - before.link.delay_s},
    ),
    Change("command_latency", "jitter", always, _jitter, _jitter_truth),
    Change("command_loss", "drop", always, _loss, lambda _, after: {"share": after.link.loss}),
    Change(
        "command_deadband",
        "drop",
        _no_dead_zone,
        _drops,
        lambda _, after: {"threshold_rpm": after.controller.dead_zone_rpm},
    ),
    Change(
        "command_deadband",
        "subtract",
        _no_dead_zone,
        _subtracts,
        lambda _, after: {"threshold_rpm": after.controller.dead_zone_rpm},
    ),
    Change(
        "speed_gain",
        "",
        always,
        _gain,
        lambda before, after: {"gain": after.controller.gain / before.controller.gain},
    ),
    Change(
        "direction_asymmetry",
        "",
        always,
        _reverse,
        lambda before, after: {
            "reverse_ratio": after.controller.reverse_gain / before.controller.reverse_gain
        },
    ),
    Change("static_map", "curve", _straight, _curve, no_truth),
)
