"""Command sequences by name, for a first look at a model."""

from __future__ import annotations

from typing import Final

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.simulator.commands import BodyCommands

_LAST_PAUSE_S = 0.8  # time for the robot to stop in the picture

SCRIPTS: Final[dict[str, tuple[tuple[float, float, float, float], ...]]] = {
    # (duration s, V rpm, theta deg, VC rpm)
    "forward": ((2.0, 80, 0, 0),),
    "sideways": ((2.0, 80, 90, 0),),
    "diagonal": ((2.0, 80, 45, 0),),
    "rotate": ((3.0, 0, 0, 40),),
    # In and out of striking distance, around the opponent, and a turn: what the robot is for.
    "tour": (
        (1.2, 90, 0, 0),
        (0.5, 0, 0, 0),
        (1.2, 90, 90, 0),
        (0.5, 0, 0, 0),
        (1.2, 90, -135, 0),
        (0.5, 0, 0, 0),
        (1.5, 0, 0, 60),
        (1.2, 60, -90, 40),
        (0.8, 100, 180, 0),
    ),
}
"""Name -> commands, one after the other."""


def scripted(name: str) -> tuple[BodyCommands, float]:
    """Return the commands of a script and the duration [s] of the drive, a final stop included.

    Args:
        name: a key of `SCRIPTS`.

    Raises:
        InputError: there is no such script.
    """
    if name not in SCRIPTS:
        raise InputError(
            f"no drive called {name!r}{did_you_mean(name, SCRIPTS)}; known: {', '.join(SCRIPTS)}"
        )
    rows, now = [], 0.0
    for duration, v, theta, vc in SCRIPTS[name]:
        rows.append((round(now, 9), v, theta, vc))
        now += duration
    rows.append((round(now, 9), 0.0, 0.0, 0.0))
    return BodyCommands.from_rows(rows), now + _LAST_PAUSE_S
