"""Where simulation and measurement disagree: the error by what the robot was doing.

Every dimension (phase, speed, direction ...) divides the samples of a channel into regions. A region's share
is its part of the channel's squared error before, so that the shares of a dimension sum to 1.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.kinematics import wheels_to_body
from mecanum_env.units import FloatArray
from sysid.compare.measured import COMMAND_STEP_RPM
from sysid.gap.report.samples import HeldCommand, Samples, wheel_of
from sysid.gap.result import Region

SETTLING_S: Final = 0.3
"""Time after a change of command until the motion counts as steady [s]; the published robot needs 0.23 s."""
_SPEED_EDGES_RPM: Final = (20.0, 40.0, 80.0, 120.0, 200.0, 400.0)
"""Edges of the speed bands [rpm]; the published losses are at 10, 40, 80 and 130 rpm."""
_PURE: Final = 0.1
"""Share of turning up to which a motion counts as straight, and of travelling up to which it is turning."""
_LEAST_SAG_V: Final = 0.1
"""Range of voltages [V] below which the error is not divided by voltage."""
_BATTERY_BANDS: Final = 3
"""Number of voltage bands."""
UNKNOWN: Final = "unknown"
"""Region of samples for which a dimension was not logged."""
_AXES: Final = ("forward", "diagonal", "left", "diagonal", "backward", "diagonal", "right", "diagonal")
"""Direction of travel in steps of 45 degrees, counter-clockwise."""

Labels = npt.NDArray[np.str_]


def regions(samples: Sequence[Samples]) -> tuple[Region, ...]:
    """Return where the error of samples is, the largest share first, ties by channel, dimension and region.

    A dimension in which all of a channel's samples fall into one region is left out. The dimension "wheel"
    compares the four wheel channels: its shares are of the error of all four. For `SETTLING_S` after a change
    of command, a motion counts as changing.
    """
    by_channel: dict[str, list[Samples]] = {}
    for part in samples:
        by_channel.setdefault(part.channel, []).append(part)
    edges = _battery_edges(samples)
    found: list[Region] = []
    tables: dict[str, FloatArray] = {}
    for channel, parts in by_channel.items():
        table = np.concatenate([_table(part) for part in parts])
        known = np.all(np.isfinite(table), axis=1)
        if not known.any():
            continue
        tables[channel] = table[known]
        labels: dict[str, list[Labels]] = {}
        for part in parts:
            for dimension, names in _labels(part, edges):
                labels.setdefault(dimension, []).append(names)
        for dimension, pieces in labels.items():
            found += _divided(channel, dimension, np.concatenate(pieces)[known], tables[channel])
    found += _by_wheel(tables)
    return tuple(sorted(found, key=lambda r: (-r.share, r.channel, r.dimension, r.region)))


def phases(time_s: FloatArray, command: HeldCommand) -> Labels:
    """Return the phase of the motion of a wheel or the body at each sample, shape (n,).

    "rest" and "steady": the command has been held longer than `SETTLING_S`; "start": it left zero;
    "coasting": it returned to zero; "reversal": it changed its sign (a body's: turned by more than a right
    angle); "rising" and "falling": its size changed otherwise.
    """
    now, earlier = command.at(time_s), command.earlier(time_s, SETTLING_S)
    size, old = np.linalg.norm(now, axis=1), np.linalg.norm(earlier, axis=1)
    moved = np.max(np.abs(now - earlier), axis=1) > COMMAND_STEP_RPM
    changing = moved | (command.since_change_s(time_s) < SETTLING_S)
    still, was_still = size <= COMMAND_STEP_RPM, old <= COMMAND_STEP_RPM
    turned = np.sum(now * earlier, axis=1) < 0.0
    return np.select(
        [~changing & still, ~changing, still, was_still, turned, size >= old],
        ["rest", "steady", "coasting", "start", "reversal", "rising"],
        "falling",
    )


def _labels(part: Samples, battery_edges_v: FloatArray | None) -> Iterator[tuple[str, Labels]]:
    """Yield the dimensions of a run's channel, each with the region of every sample."""
    yield "phase", phases(part.time_s, part.command)
    wheels = _last_motion(part.time_s, part.wheels)
    own = _last_motion(part.time_s, part.command)
    yield "speed", _speed(own if wheel_of(part.channel) else wheels)
    yield "direction", _bench_direction(wheels) if wheels.shape[1] == 1 else _direction(wheels)
    thirds = np.searchsorted([1.0 / 3.0, 2.0 / 3.0], part.time_s / max(float(part.time_s[-1]), 1e-9))
    yield "time", np.array(["early", "middle", "late"])[thirds]
    yield "repeat", np.full(part.time_s.size, f"repeat {part.repeat + 1}")
    if battery_edges_v is not None:
        yield "battery", _battery(part, battery_edges_v)
    if wheels.shape[1] == 4:
        yield "heading", _heading(wheels, part.yaw_rad)


def _last_motion(time_s: FloatArray, command: HeldCommand) -> FloatArray:
    """Return the command at each sample; while the robot coasts, the command before."""
    now = command.at(time_s)
    still = np.max(np.abs(now), axis=1) <= COMMAND_STEP_RPM
    return np.where(still[:, None], command.earlier(time_s, SETTLING_S), now)


def _speed(command_rpm: FloatArray) -> Labels:
    """Return the band of the fastest wheel's command."""
    size = np.max(np.abs(command_rpm), axis=1)
    edges = np.array([COMMAND_STEP_RPM, *_SPEED_EDGES_RPM])
    names = ["0 rpm", f"up to {edges[1]:g} rpm"]
    names += [f"{a:g} .. {b:g} rpm" for a, b in pairwise(edges[1:])]
    names.append(f"above {edges[-1]:g} rpm")
    bands: Labels = np.array(names)[np.searchsorted(edges, size, side="left")]
    return bands


def _bench_direction(command_rpm: FloatArray) -> Labels:
    speed = command_rpm[:, 0]
    moving = [speed > COMMAND_STEP_RPM, speed < -COMMAND_STEP_RPM]
    return np.select(moving, ["forward", "backward"], "at rest")


def _direction(wheels_rpm: FloatArray) -> Labels:
    """Return the body's direction: along an axis within 22.5 degrees, diagonal between, turning, mixed."""
    body = wheels_to_body(wheels_rpm)
    travel, turn = np.hypot(body[:, 0], body[:, 1]), np.abs(body[:, 2])
    total = travel + turn
    octant = np.rint(np.arctan2(body[:, 1], body[:, 0]) / (np.pi / 4.0)).astype(int) % 8
    return np.select(
        [total <= COMMAND_STEP_RPM, turn <= _PURE * total, travel <= _PURE * total],
        ["at rest", np.array(_AXES)[octant], "turning"],
        "mixed",
    )


def _heading(wheels_rpm: FloatArray, yaw_rad: FloatArray | None) -> Labels:
    """Return towards which side of the world the robot travels: its yaw plus the direction commanded."""
    if yaw_rad is None:
        return np.full(len(wheels_rpm), UNKNOWN)
    body = wheels_to_body(wheels_rpm)
    travel = np.hypot(body[:, 0], body[:, 1])
    angle = np.where(np.isfinite(yaw_rad), yaw_rad, 0.0) + np.arctan2(body[:, 1], body[:, 0])
    quadrant = np.rint(angle / (np.pi / 2.0)).astype(int) % 4
    towards = np.array(["towards +x", "towards +y", "towards -x", "towards -y"])[quadrant]
    return np.select([~np.isfinite(yaw_rad), travel <= COMMAND_STEP_RPM], [UNKNOWN, "on the spot"], towards)


def _battery_edges(samples: Sequence[Samples]) -> FloatArray | None:
    """Return the edges of equally wide voltage bands [V]; None if it was not logged or is constant."""
    logged = [part.battery_v[np.isfinite(part.battery_v)] for part in samples if part.battery_v is not None]
    volts = np.concatenate(logged) if logged else np.zeros(0)
    if volts.size == 0 or np.ptp(volts) < _LEAST_SAG_V:
        return None
    edges: FloatArray = np.linspace(np.min(volts), np.max(volts), _BATTERY_BANDS + 1)
    return edges


def _battery(part: Samples, edges_v: FloatArray) -> Labels:
    if part.battery_v is None:
        return np.full(part.time_s.size, UNKNOWN)
    names = np.array([f"{a:.2f} .. {b:.2f} V" for a, b in pairwise(edges_v)])
    inside = np.searchsorted(edges_v[1:-1], part.battery_v, side="right")
    return np.where(np.isfinite(part.battery_v), names[inside], UNKNOWN)


def _divided(channel: str, dimension: str, names: Labels, table: FloatArray) -> Iterator[Region]:
    """Yield the regions of a channel's rows (weight, error before, error after), if more than one."""
    found, inside = np.unique(names, return_inverse=True)
    if found.size < 2:
        return
    sums = []
    for i in range(found.size):
        weight, before, after = table[inside == i].T
        sums.append((float(weight @ before**2), float(weight @ after**2), float(weight.sum()), weight.size))
    total = sum(square for square, *_ in sums)
    for name, (before_square, after_square, total_weight, count) in zip(found, sums, strict=True):
        yield Region(
            channel=channel,
            dimension=dimension,
            region=str(name),
            rms=math.sqrt(before_square / total_weight),
            rms_after=math.sqrt(after_square / total_weight),
            share=before_square / total if total > 0.0 else 0.0,
            samples=count,
        )


def _by_wheel(tables: Mapping[str, FloatArray]) -> Iterator[Region]:
    """Yield one region per wheel channel, with shares of the error of all of them."""
    wheels = {channel: table for channel, table in tables.items() if wheel_of(channel)}
    if wheels:
        names = np.repeat(list(wheels), [len(table) for table in wheels.values()])
        for region in _divided("", "wheel", names, np.concatenate(list(wheels.values()))):
            yield replace(region, channel=region.region, region=wheel_of(region.region) or "")


def _table(part: Samples) -> FloatArray:
    """Return the weight, error before and error after of each sample, shape (n, 3)."""
    weight = np.ones(part.time_s.size) if part.weight is None else part.weight
    return np.stack([weight, *part.errors()], axis=1)
