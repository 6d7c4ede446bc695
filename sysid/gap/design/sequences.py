"""Command sequences to choose the next experiment from: structured families, and small random changes.

A sequence is an array of rows, each held for the shortest time that a command may last: (n, 1) on the bench
[rpm], (n, 3) on the robot (V [rpm], theta [deg], VC [rpm]). It begins and ends at rest, and the platform
takes it: whole rpm and degrees, no command beyond its limit, and on the robot a path inside the field that
starts in its middle.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from mecanum_env.kinematics import Geometry, command_to_twist, command_to_wheels, round_command, yaw_arm_m
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.gap.design.limits import Limits
from sysid.logs.runs import Level

FIELD_M: Final = 9.0
"""Side of the square field [m]: that of the sport."""
_MARGIN_M: Final = 1.0
"""Least distance of the robot's centre to the edge [m], on the path that the commands ask for."""
_LONGEST_HOLD: Final = 8
"""Longest hold of a random command, in beats."""
_SPEED_SHARES: Final = (0.04, 0.08, 0.15, 0.35, 0.7, 1.0)
"""Speeds of the bench profiles, as shares of the limit."""
_RANDOM: Final[dict[Level, int]] = {"bench": 12, "robot": 6}
"""Number of random sequences in the library."""


def _legal(rows: FloatArray, limits: Limits) -> FloatArray | None:
    """Return a sequence that the platform takes; None if its path leaves the field.

    Rows, shape (n, 1) or (n, 3), get rest before and after. V and VC are cut to their limits, and rows that
    then ask too much of a wheel are slowed down without changing their direction; surplus rows are cut.
    """
    rows = rows[: limits.driven_rows]
    rest = np.zeros((limits.rest_rows, rows.shape[1]))
    rows = np.concatenate([rest, _rounded(rows, limits), rest])
    if limits.geometry is not None:
        path = path_m(rows, limits.geometry, limits.period_s)
        if np.max(np.abs(path)) > 0.5 * FIELD_M - _MARGIN_M:
            return None
    return rows


def path_m(rows: FloatArray, geometry: Geometry, period_s: float) -> FloatArray:
    """Return the path (n, 2) [m] that command rows (n, 3) ask for, without dynamics.

    It starts at the origin, heading along x.
    """
    twist = command_to_twist(rows[:, 0], rows[:, 1], rows[:, 2], geometry) * period_s
    yaw = np.cumsum(twist[:, 2]) - 0.5 * twist[:, 2]
    cos, sin = np.cos(yaw), np.sin(yaw)
    steps = np.stack([cos * twist[:, 0] - sin * twist[:, 1], sin * twist[:, 0] + cos * twist[:, 1]], axis=-1)
    return np.asarray(np.cumsum(steps, axis=0))


def library(limits: Limits, rng: np.random.Generator) -> list[FloatArray]:
    """Return the structured families of sequences and some random ones, all of them _legal."""
    if limits.geometry is None:
        raw = [profile[:, None] for profile in _bench_profiles(limits)]
    else:
        raw = list(_robot_sequences(limits, limits.geometry))
    raw += [_random_sequence(limits, rng) for _ in range(_RANDOM[limits.level])]
    legal = (_legal(rows, limits) for rows in raw)
    found = [rows for rows in legal if rows is not None and np.any(rows)]
    # Where commands must be held for long, several profiles become one.
    return list({(rows.shape, rows.tobytes()): rows for rows in found}.values())


def changed(rows: FloatArray, limits: Limits, rng: np.random.Generator) -> FloatArray | None:
    """Return _legal rows with one random change: a hold scaled, lengthened, exchanged, split or replaced.

    None if the sequence is all rest, or if its path would leave the field.
    """
    edges = np.flatnonzero(np.any(rows[1:] != rows[:-1], axis=1)) + 1
    holds = [(rows[a], int(b - a)) for a, b in pairwise([0, *edges, len(rows)])][1:-1]
    if not holds:
        return None
    at = int(rng.integers(len(holds)))
    level, length = holds[at]
    kind = int(rng.integers(5))
    if kind == 0:
        holds[at] = level * _random_factors(level.size, rng), length
    elif kind == 1:
        holds[at] = level, max(1, length + int(rng.choice([-2, -1, 1, 2])))
    elif kind == 2:
        other = int(rng.integers(len(holds)))
        holds[at], holds[other] = holds[other], holds[at]
    elif kind == 3 and length > 1:
        first = int(rng.integers(1, length))
        holds[at : at + 1] = [(level, first), (_random_command(limits, level.size, rng), length - first)]
    else:
        holds[at] = _random_command(limits, level.size, rng), length
    return _legal(np.concatenate([np.tile(value, (count, 1)) for value, count in holds]), limits)


def _rounded(rows: FloatArray, limits: Limits) -> FloatArray:
    quantum, limit = limits.quantum_rpm, _whole_below(limits.limit_rpm, limits.quantum_rpm)
    if limits.geometry is None:
        whole = rows if quantum == 0.0 else np.rint(rows / quantum) * quantum
        return np.asarray(np.clip(whole, -limit, limit))
    v, theta, vc = round_command(rows[:, 0], rows[:, 1], rows[:, 2], quantum)
    # The robot's V is not negative: backwards is another direction.
    theta = np.where(v < 0.0, theta + 180.0, theta)
    v = np.minimum(np.abs(v), _whole_below(limits.v_rpm, quantum))
    most_vc = _whole_below(limits.vc_rpm, quantum)
    vc = np.clip(vc, -most_vc, most_vc)
    theta = (theta + 179.0) % 360.0 - 179.0
    largest = np.max(np.abs(command_to_wheels(v, theta, vc)), axis=1)
    share = np.where(largest > limit, limit / np.maximum(largest, 1e-12), 1.0)
    down = [np.trunc(x * share / quantum + 1e-9) * quantum if quantum else x * share for x in (v, vc)]
    v, vc = (np.where(share < 1.0, lower, x) for lower, x in zip(down, (v, vc), strict=True))
    return np.stack([v, np.where(v == 0.0, 0.0, theta), vc], axis=-1)


def _whole_below(limit_rpm: float, quantum_rpm: float) -> float:
    """Return the largest multiple of a quantum within a limit [rpm]; the limit itself without a quantum."""
    if quantum_rpm == 0.0 or not math.isfinite(limit_rpm):
        return limit_rpm
    return math.floor(limit_rpm / quantum_rpm + 1e-9) * quantum_rpm


def _bench_profiles(limits: Limits) -> Iterator[FloatArray]:
    """Yield speed profiles for the bench (n,) [rpm]."""
    top, length = limits.limit_rpm, limits.driven_rows
    speeds = [share * top for share in _SPEED_SHARES]
    for beats in (3, 6):
        yield _held([v for s in speeds for v in (s, 0.0)], limits.rows_of(beats))
        yield _held([v for s in speeds[::-1] for v in (s, -s)], limits.rows_of(beats))
    for speed in speeds[1:]:
        for beats in (1, 2, 4, 8):
            yield _reversals(speed, limits.rows_of(beats), length)
        yield _chirp(speed, limits)
        for width, gap in ((1, 3), (2, 6)):
            yield _pulses(speed, limits.rows_of(width), limits.rows_of(gap), length)
    for step, beats in ((1, 1), (1, 2), (2, 1), (4, 1), (8, 2)):
        yield _staircase(step * max(limits.quantum_rpm, 1e-3 * top), limits.rows_of(beats), length)
    yield np.full(length, 0.5 * top)
    up = np.linspace(0.0, top, max(1, length // 2))
    yield np.concatenate([up, up[::-1]])


def _robot_sequences(limits: Limits, geometry: Geometry) -> Iterator[FloatArray]:
    """Yield sequences for the robot: forward, sideways, diagonal, turning, and at two headings in turn."""
    length, top = limits.driven_rows, min(limits.limit_rpm, limits.v_rpm)
    turn_rpm = min(0.5 * limits.limit_rpm, limits.vc_rpm)
    straight, turning = _robot_shapes(top, limits), _robot_shapes(turn_rpm, limits)
    for shape, turn in zip(straight, turning, strict=True):
        for direction in (0.0, 90.0, 45.0):
            yield _along(shape, direction)
        yield np.stack([0.0 * turn, 0.0 * turn, turn], axis=-1)
    for shape, turn in list(zip(straight, turning, strict=True))[:2]:
        yield np.concatenate([_along(shape, 0.0)[:, :2], 0.8 * turn[::-1, None]], axis=1)
    if turn_rpm == 0.0:
        return
    rate = turn_rpm * RAD_S_PER_RPM * geometry.wheel_radius_m / yaw_arm_m(geometry)
    for angle in (90.0, 180.0):
        rows = max(1, round(np.radians(angle) / rate / limits.period_s))
        turned = np.tile([0.0, 0.0, turn_rpm], (rows, 1))
        pause = np.zeros((limits.rows_of(3), 3))
        half = max(limits.rows_of(4), (length - len(turned) - len(pause)) // 2)
        for direction in (0.0, 90.0):
            for share, beats in ((0.35, 4), (0.15, 6)):
                leg = _along(_reversals(share * top, limits.rows_of(beats), half), direction)
                yield np.concatenate([leg, turned, pause, leg])


def _robot_shapes(top: float, limits: Limits) -> list[FloatArray]:
    """Return profiles (n,) of V or VC for the robot, up to about `top` [rpm]."""
    length, beats = limits.driven_rows, limits.rows_of
    return [
        _held([v for s in (0.08, 0.35, 0.7, 1.0) for v in (s * top, 0.0, -s * top, 0.0)], beats(4)),
        _reversals(0.15 * top, beats(4), length),
        _reversals(0.35 * top, beats(6), length),
        _chirp(0.25 * top, limits),
        _staircase(max(limits.quantum_rpm, 0.01 * top), beats(2), length),
        # Up to the limit and back, so slowly that no wheel slips.
        np.clip(_staircase(0.08 * top, beats(1), length), -top, top),
        _pulses(0.35 * top, beats(2), beats(5), length),
    ]


def _along(profile: FloatArray, direction_deg: float) -> FloatArray:
    return np.stack([profile, np.full(profile.size, direction_deg), np.zeros(profile.size)], axis=-1)


def _held(values: Sequence[float], rows: int) -> FloatArray:
    return np.repeat(np.asarray(values, float), rows)


def _reversals(speed: float, hold: int, length: int) -> FloatArray:
    return np.resize(_held([speed, -speed], hold), max(1, length // hold) * hold)


def _chirp(speed: float, limits: Limits) -> FloatArray:
    holds = [limits.rows_of(beats) for beats in (9, 8, 7, 6, 5, 4, 3, 2, 2, 1, 1, 1, 1)]
    signs = [(-1.0) ** i for i in range(len(holds))]
    return speed * np.repeat(signs, holds)


def _pulses(speed: float, width: int, gap: int, length: int) -> FloatArray:
    pulse = np.concatenate([np.full(width, speed), np.zeros(gap)])
    return np.resize(np.concatenate([pulse, -pulse]), length)


def _staircase(step: float, hold: int, length: int) -> FloatArray:
    """Return a staircase from -m to m steps and back (n,) [rpm], with m as large as the length allows."""
    most = max(1, length // (4 * hold))
    up = np.arange(-most, most + 1)
    return _held([*(step * up), *(step * up[::-1])], hold)


def _random_sequence(limits: Limits, rng: np.random.Generator) -> FloatArray:
    size, length = 1 if limits.geometry is None else 3, limits.driven_rows
    longest = limits.rows_of(_LONGEST_HOLD)
    holds = [
        np.tile(_random_command(limits, size, rng), (int(rng.integers(1, longest + 1)), 1))
        for _ in range(length)
    ]
    return np.concatenate(holds)[:length]


def _random_command(limits: Limits, size: int, rng: np.random.Generator) -> FloatArray:
    """Return a random command: log-uniform speed, and rest in one of ten."""
    if rng.random() < 0.1:
        return np.zeros(size)
    top = limits.limit_rpm
    speed = min(top, limits.v_rpm) * float(np.exp(rng.uniform(np.log(0.02), 0.0)))
    if size == 1:
        return np.array([speed * rng.choice([-1.0, 1.0])])
    turn = min(0.5 * top, limits.vc_rpm) * float(rng.uniform(-1.0, 1.0)) if rng.random() < 0.3 else 0.0
    return np.array([speed, 15.0 * float(rng.integers(24)), turn])


def _random_factors(size: int, rng: np.random.Generator) -> FloatArray:
    """Return log-normal factors on the speeds of a command, some negative; 1 for its direction."""
    factors = np.exp(rng.normal(0.0, 0.3, size)) * np.where(rng.random(size) < 0.2, -1.0, 1.0)
    if size == 3:
        factors[1] = 1.0
    return np.asarray(factors)
