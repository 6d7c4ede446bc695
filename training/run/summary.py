"""What a series of fights comes to: outcomes with an interval, and how even the loop was."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from mecanum_env.files import write_json
from training.evaluate import Share, share
from training.run.loop import Fight

FORMAT: Final = "mecanum-fights/1"
FILE_NAME: Final = "fights.json"


def success_of(fights: Sequence[Fight]) -> Share:
    """Return the share of fights that were won, with its interval."""
    return share(sum(fight.outcome == "won" for fight in fights), len(fights))


def timing(fights: Sequence[Fight]) -> dict[str, float]:
    """Return how even the loop was, over all fights.

    `period_ms` is the mean time between decisions, `jitter_ms` its standard deviation, `late_ms` the 99th
    percentile of its distance from the mean and `worst_ms` the largest; `thinking_ms` is the 99th percentile
    of the controller's time. Of the `commands`, `late` came too late; `missed` counts observations that never
    came.
    """
    intervals = 1e3 * np.array([one for fight in fights for one in fight.intervals_s])
    thinking = 1e3 * np.array([one for fight in fights for one in fight.thinking_s])
    off = np.abs(intervals - intervals.mean()) if intervals.size else np.zeros(1)
    return {
        "period_ms": float(intervals.mean()) if intervals.size else 0.0,
        "jitter_ms": float(intervals.std()) if intervals.size else 0.0,
        "late_ms": float(np.percentile(off, 99.0)),
        "worst_ms": float(off.max()),
        "thinking_ms": float(np.percentile(thinking, 99.0)) if thinking.size else 0.0,
        "commands": float(sum(fight.commands for fight in fights)),
        "missed": float(sum(fight.missed for fight in fights)),
        "late": float(sum(fight.late for fight in fights)),
    }


def timing_text(fights: Sequence[Fight]) -> str:
    """Return the timing of the loop in words."""
    t = timing(fights)
    return (
        f"period {t['period_ms']:.1f} ms, jitter {t['jitter_ms']:.1f} ms (99 % within {t['late_ms']:.1f} ms, "
        f"worst {t['worst_ms']:.1f} ms); of {t['commands']:.0f} commands {t['late']:.0f} came too late, "
        f"{t['missed']:.0f} observations never; the controller took {t['thinking_ms']:.2f} ms (99 %)"
    )


def write_summary(path: Any, controller: str, robot: str, fights: Sequence[Fight]) -> None:
    """Write the fights of a controller against a robot, both by name, to the JSON file `path`."""
    won = success_of(fights) if fights else None
    write_json(
        path,
        {
            "format": FORMAT,
            "controller": controller,
            "robot": robot,
            "success": None if won is None else {"value": won.value, "low": won.low, "high": won.high},
            "timing": timing(fights),
            "fights": [
                {
                    "fight": one.number,
                    "outcome": one.outcome,
                    "commands": one.commands,
                    "missed": one.missed,
                    "late": one.late,
                }
                for one in fights
            ],
        },
    )
