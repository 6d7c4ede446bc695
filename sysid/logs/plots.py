"""A picture of logs: commands and speeds of every command sequence, repeats over each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mecanum_env.errors import InputError
from mecanum_env.files import atomic_path
from mecanum_env.kinematics import WHEEL_SPEEDS
from sysid.logs.runs import Dataset, Run

SUFFIXES: Final = (".png", ".svg", ".pdf")
_MOST: Final = 40
"""Sequences in one picture."""
_COLOURS: Final = ("#c8102e", "#1f77b4", "#2ca02c", "#9467bd")
"""One for each wheel: fl, fr, rl, rr; the first is the bench's."""


def plot_logs(dataset: Dataset, path: Path) -> int:
    """Write a picture of a dataset to a path (.png, .svg, .pdf); return how many sequences it shows.

    Raises:
        InputError: another suffix, or the picture cannot be written.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: a picture's name must end in {', '.join(SUFFIXES)}")
    groups = list(dataset.groups().items())[:_MOST]
    columns = 1 if len(groups) == 1 else 2
    rows = math.ceil(len(groups) / columns)
    figure = Figure(figsize=(13.0, 0.6 + 2.3 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for place, (name, runs) in zip(axes, groups, strict=False):
        _draw(place, name, runs)
    for place in axes[len(groups) :]:
        place.axis("off")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=len(labels), fontsize=8)
    figure.suptitle(dataset.name, x=0.01, ha="left", fontsize=11)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=110)
    return len(groups)


def _draw(axes: Axes, name: str, runs: Sequence[Run]) -> None:
    """Draw the commands of the first run of a group, dashed, and the wheel speeds of all."""
    speeds = ("speed_rpm",) if runs[0].level == "bench" else WHEEL_SPEEDS
    for index, (column, colour) in enumerate(zip(speeds, _COLOURS, strict=False)):
        label = "" if column == "speed_rpm" else f" {column.split('_')[1]}"
        axes.step(
            runs[0].time_s,
            runs[0].command.wheels_rpm[:, index],
            where="post",
            color=colour if label else "0.2",
            linestyle="--",
            linewidth=0.9,
            label=f"commanded{label}",
        )
        for number, run in enumerate(run for run in runs if column in run.channels):
            use = run.finite(column)
            shown = f"measured{label}" if number == 0 else None
            axes.plot(
                run.time_s[use], run.channel(column)[use], color=colour, linewidth=0.7, alpha=0.7, label=shown
            )
    times = f", {len(runs)} times" if len(runs) > 1 else ""
    axes.set_title(f"{name} ({runs[0].split}{times})", loc="left", fontsize=9)
    axes.set_ylabel("rpm", fontsize=8)
    axes.set_xlabel("s", fontsize=8)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.3)
