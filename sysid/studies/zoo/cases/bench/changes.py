"""Every change that a name and form of the contract covers, and which names are twins on the bench."""

from __future__ import annotations

from typing import Final

from sysid.studies.zoo.cases.bench.change import Change
from sysid.studies.zoo.cases.bench.command_changes import COMMAND_CHANGES
from sysid.studies.zoo.cases.bench.limit_changes import LIMIT_CHANGES
from sysid.studies.zoo.cases.bench.load_changes import LOAD_CHANGES, SENSOR_CHANGES

CHANGES: Final[tuple[Change, ...]] = (*COMMAND_CHANGES, *LIMIT_CHANGES, *LOAD_CHANGES, *SENSOR_CHANGES)

TWINS: Final = {
    ("speed_gain", ""): ("sensor_scale",),
    ("sensor_scale", ""): ("speed_gain",),
    ("command_latency", "fixed"): ("sensor_latency",),
    ("sensor_latency", "all"): ("command_latency",),
}
"""(name, form) -> names that no log of commands and one wheel's speed can tell from it."""

UNSEEN_WHEN_GENTLE: Final = (
    ("direction_asymmetry", ""),
    ("speed_saturation", "clip"),
    ("speed_saturation", "supply"),
    ("acceleration_limit", "set_point"),
    ("acceleration_limit", "drive"),
    ("acceleration_limit", "s_curve"),
)
"""(name, form) of changes that slow forward driving below half of the top speed does not show."""


def slow_twins(change: Change, time_constant_s: float, seconds: float) -> tuple[str, ...]:
    """Return the names that a run of `seconds` cannot tell from a change with a time constant.

    A warm-up of the gain that takes longer than the run falls as evenly as a gain does with the battery.
    """
    even = change.name == "warm_up" and change.form == "gain" and time_constant_s > 2.0 * seconds
    return ("battery_sag",) if even else ()


def change_of(name: str, form: str) -> Change:
    """Return the change of a name and form.

    Raises:
        KeyError: there is none.
    """
    for change in CHANGES:
        if (change.name, change.form) == (name, form):
            return change
    raise KeyError(f"{name}/{form}: no such change")
