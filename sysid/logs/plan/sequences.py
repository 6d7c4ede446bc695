"""The command sequences of a recording session, each with what it is there to show.

Together they cover what the law and the named effects need: every level both ways (gain, ceiling,
asymmetry), low speeds from rest and through zero (dead zone, friction), reversals (backlash), long holds
(integral action, warm-up, a falling battery), and steps between random speeds with holds of every length
(the law and its delay).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final, Literal, TypeAlias

import numpy as np

from mecanum_env.errors import InputError, require_one_of
from mecanum_env.kinematics import BODY_COMMAND, command_to_twist, command_to_wheels, require_mecanum
from mecanum_env.model import Robot
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.logs.runs import BENCH_COMMAND, Split

Form: TypeAlias = Literal["bench", "floor"]

_LEVELS: Final = (0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0, 1.1, 0.6, 0.2)
"""Shares of the top speed; one above it, where the drive's ceiling shows."""
_FLOOR_LEVELS: Final = (0.05, 0.1, 0.2, 0.4, 0.7, 1.0)
_LOW: Final = (0.02, 0.04, 0.06, 0.08, 0.12)
_REVERSED: Final = (0.1, 0.3, 0.6, 1.0)
_RANDOM_S: Final = 40.0
"""Duration of a sequence of random steps [s]."""
_LONG_HOLD_S: Final = 30.0
_SHORT_HOLD_S: Final = 6.0
_SMALL: Final = 0.15
"""Share of the top speed below which every fifth random level lies."""
_WHOLE_RPM: Final = 50.0
"""Top speed from which on commands are whole rpm; slower drives take hundredths."""


@dataclass(frozen=True)
class Size:
    """What is known of a robot before anything is recorded.

    Raises:
        InputError: a number that cannot be, or a floor plan of a robot without four Mecanum wheels.
    """

    form: Form = "bench"
    top_rpm: float = 135.0
    """Fastest speed of a wheel [rpm]."""
    period_s: float = 0.1
    """Time between two commands that the robot takes [s]."""
    rise_s: float = 0.3
    """About how long a wheel takes to reach a new speed [s]."""
    room_m: float = 3.0
    """Side of the free square around the robot, for the floor [m]."""
    robot: Robot = field(default_factory=Robot)

    def __post_init__(self) -> None:
        require_one_of("--form", self.form, ("bench", "floor"))
        for option, value, low, high in (
            ("--top-speed", self.top_rpm, 1.0, 1e5),
            ("--period", self.period_s, 0.001, 1.0),
            ("--rise", self.rise_s, 0.001, 5.0),
            ("--room", self.room_m, 0.1, 1e3),
        ):
            if not low <= value <= high:
                raise InputError(f"{option} {value:g}, must be a number from {low:g} to {high:g}")
        if self.form == "floor":
            require_mecanum(self.robot, "floor plans are for robots")
            fastest_m_s = self.top_rpm * RAD_S_PER_RPM * self.robot.wheel_radius_m
            if fastest_m_s * self.hold_s > self.room_m / 2.0:
                raise InputError(
                    f"--room {self.room_m:g}: at {self.top_rpm:g} rpm the robot goes "
                    f"{fastest_m_s * self.hold_s:.2g} "
                    f"m before its speed has settled; give a room of at least "
                    f"{2 * fastest_m_s * self.hold_s:.2g} m, "
                    "or a smaller --top-speed"
                )

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the commands."""
        return BENCH_COMMAND if self.form == "bench" else BODY_COMMAND

    @property
    def hold_s(self) -> float:
        """Time after which a new speed has settled [s]."""
        return max(0.5, 3.0 * self.rise_s, 2.0 * self.period_s)

    def beats(self, seconds: float) -> int:
        """Return how many command periods, at least one, last about so many seconds."""
        return max(1, round(seconds / self.period_s))


@dataclass(frozen=True, eq=False)
class Sequence:
    """One sequence of commands, which begins and ends at rest."""

    name: str
    shows: str
    """What it is there to show, in words."""
    commands: FloatArray
    """One row per command period, shape (n, columns)."""
    split: Split
    repeats: int

    def wheels_rpm(self, size: Size) -> FloatArray:
        """Return the command of one wheel, on the floor the front left one [rpm], shape (n,)."""
        return self.commands[:, 0] if size.form == "bench" else command_to_wheels(*self.commands.T)[:, 0]

    def duration_s(self, size: Size) -> float:
        """Return how long it lasts [s]."""
        return len(self.commands) * size.period_s


_Move: TypeAlias = tuple[tuple[float, ...], float]
"""A command and for how long it is held [s]; shares of the top speed: of a wheel, or forward, left and
turning."""

_SHOWS: Final = {
    "levels": "every speed both ways: gain, friction, ceiling, a difference between directions",
    "low": "small speeds from rest and slowly through zero: dead zone, static friction",
    "reversals": "changes of direction: play in the gear, friction",
    "holds": "long holds: slow integral action, warming up, a falling battery",
    "steps": "steps between random speeds, held for every length of time: the law and its delay",
    "validation": "new random steps that no fit sees: chooses between explanations",
    "test": "new random steps that nothing sees before the end: the figures of the report",
}


def base_sequences(size: Size) -> tuple[Sequence, ...]:
    """Return the sequences that every session has, in the order in which they are recorded."""
    moves = {"bench": _bench_moves, "floor": _floor_moves}[size.form](size)
    fixed = [
        Sequence(n, _SHOWS[n], _rows(size, m), "fit", 1 if n == "holds" else 2) for n, m in moves.items()
    ]
    validation = _random(size, 1000, "validation", "validation", 2)
    return (*fixed, steps_sequence(size, 1), validation, _random(size, 1001, "test", "test", 3))


def steps_sequence(size: Size, number: int) -> Sequence:
    """Return the random steps for the fit with a number, from 1; the first are recorded twice."""
    return _random(size, number, f"steps_{number}", "fit", 2 if number == 1 else 1)


def _bench_moves(size: Size) -> dict[str, list[_Move]]:
    hold = size.hold_s
    stairs = [*np.arange(-10, 11), *np.arange(10, -11, -1)]
    return {
        "levels": [((way * share,), hold) for way in (1.0, -1.0) for share in (*_LEVELS, 0.0)],
        "low": [
            *(((way * share,), hold) for share in _LOW for way in (1.0, 0.0, -1.0, 0.0)),
            *(((float(step) / 100.0,), 0.5 * hold) for step in stairs),
        ],
        "reversals": [((way * share,), hold) for share in _REVERSED for way in (1.0, -1.0) * 3],
        "holds": _holds(size, max(_LONG_HOLD_S, 30.0 * size.rise_s)),
    }


def _floor_moves(size: Size) -> dict[str, list[_Move]]:
    hold = size.hold_s
    straight = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.5, 0.5, 0.0), (0.6, 0.0, 0.4)]
    return {
        "levels": [
            m for way in straight for share in _FLOOR_LEVELS for m in _there_and_back(way, share, hold, True)
        ],
        "low": [m for way in straight[:3] for share in _LOW for m in _there_and_back(way, share, hold, True)],
        "reversals": [
            m for way in straight for share in _REVERSED for m in _there_and_back(way, share, hold, False) * 2
        ],
        "holds": _holds(size, max(_LONG_HOLD_S, 30.0 * size.rise_s)),
    }


def _holds(size: Size, seconds: float) -> list[_Move]:
    """Return one long hold each way; on the floor the robot turns on the spot, which needs no room."""
    way = (0.6,) if size.form == "bench" else (0.0, 0.0, 0.5)
    back, rest = tuple(-part for part in way), tuple(0.0 * part for part in way)
    return [(way, seconds), (rest, size.hold_s), (back, seconds)]


def _there_and_back(way: tuple[float, ...], share: float, hold_s: float, rest: bool) -> list[_Move]:
    """Return a move and the same move back, with a rest after each where asked."""
    moves: list[_Move] = []
    for sign in (share, -share):
        moves.append((tuple(sign * part for part in way), hold_s))
        moves += [((0.0,) * len(way), hold_s)] if rest else []
    return moves


def _random(size: Size, number: int, name: str, split: Split, repeats: int) -> Sequence:
    rng = np.random.default_rng((20, number))
    draw = {"bench": _random_bench, "floor": _random_floor}[size.form]
    moves, left = [], _RANDOM_S
    for block in draw(size, rng):
        moves += block
        left -= sum(seconds for _, seconds in block)
        if left <= 0.0:
            break
    # What is held out shows slow effects, too.
    moves += _holds(size, _SHORT_HOLD_S) if split != "fit" else []
    return Sequence(name, _SHOWS[name.split("_")[0]], _rows(size, moves), split, repeats)


def _draw_hold_s(size: Size, rng: np.random.Generator) -> float:
    """Return a hold between one command period and one in which the speed has long settled [s]."""
    return float(np.exp(rng.uniform(math.log(size.period_s), math.log(2.0 * size.hold_s))))


def _draw_share(rng: np.random.Generator) -> float:
    """Return a level as a share of the top speed: every tenth is rest, every fifth a small one."""
    kind = rng.random()
    return 0.0 if kind < 0.1 else float(rng.uniform(-1.0, 1.0) * (_SMALL if kind < 0.3 else 1.05))


def _random_bench(size: Size, rng: np.random.Generator) -> Iterator[list[_Move]]:
    while True:
        yield [((_draw_share(rng),), _draw_hold_s(size, rng))]


def _random_floor(size: Size, rng: np.random.Generator) -> Iterator[list[_Move]]:
    """Yield blocks of moves that stay in the room: some moves out, and the same way back."""
    while True:
        out: list[_Move] = []
        for _ in range(int(rng.integers(1, 4))):
            way = rng.dirichlet((0.7, 0.7, 0.7)) * rng.choice((-1.0, 1.0), 3)
            share = abs(_draw_share(rng))
            out.append((tuple(float(share * part) for part in way), _draw_hold_s(size, rng)))
        back = [(tuple(-part for part in way), seconds) for way, seconds in reversed(out)]
        block = [*out, *back, ((0.0,) * 3, size.hold_s / 2.0)]
        if _reach_m(size, _rows(size, block)) <= size.room_m / 2.0:
            yield block


def _reach_m(size: Size, commands: FloatArray) -> float:
    """Return how far commands take the robot from its start at most, if all wheels follow [m]."""
    v, theta, vc = commands.T
    twist = command_to_twist(v, theta, vc, size.robot)
    yaw = np.cumsum(twist[:, 2]) * size.period_s
    world = (twist[:, 0] + 1j * twist[:, 1]) * np.exp(1j * yaw)
    return float(np.max(np.abs(np.cumsum(world)))) * size.period_s


def _rows(size: Size, moves: list[_Move]) -> FloatArray:
    """Return commands, one row per period, between two rests, in the units of the columns."""
    rest: _Move = ((0.0,) * len(moves[0][0]), size.hold_s)
    held = [(way, size.beats(seconds)) for way, seconds in (rest, *moves, rest)]
    shares = np.repeat(np.array([way for way, _ in held]), [beats for _, beats in held], axis=0)
    digits = 0 if size.top_rpm >= _WHOLE_RPM else 2
    # Adding 0.0 turns -0.0 into 0.0.
    if size.form == "bench":
        return np.round(size.top_rpm * shares, digits) + 0.0
    v = np.round(size.top_rpm * np.hypot(shares[:, 0], shares[:, 1]), digits)
    theta = np.round(np.rad2deg(np.arctan2(shares[:, 1] + 0.0, shares[:, 0] + 0.0)))
    vc = np.round(size.top_rpm * shares[:, 2], digits) + 0.0
    return np.column_stack([v, np.where(v > 0.0, theta, 0.0) + 0.0, vc])
