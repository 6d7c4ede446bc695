"""What logs show: how a run starts, its changes of command, and each channel as the mean of its repeats."""

from sysid.compare.measured.commands import COMMAND_STEP_RPM, activity_rpm, changes_from_rest, command_changes
from sysid.compare.measured.observations import (
    EDGE_S,
    WINDOW_S,
    Block,
    Observations,
    Situation,
    as_compared,
    displacements,
    observe,
)
from sysid.compare.measured.start import Start, start_of
from sysid.compare.measured.subset import (
    is_long,
    most_active,
    most_active_runs,
    pieces,
    select_runs,
    small_command_runs,
)

__all__ = [
    "COMMAND_STEP_RPM",
    "EDGE_S",
    "WINDOW_S",
    "Block",
    "Observations",
    "Situation",
    "Start",
    "activity_rpm",
    "as_compared",
    "changes_from_rest",
    "command_changes",
    "displacements",
    "is_long",
    "most_active",
    "most_active_runs",
    "observe",
    "pieces",
    "select_runs",
    "small_command_runs",
    "start_of",
]
