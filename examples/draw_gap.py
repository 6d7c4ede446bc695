"""Draw a study of the gap: the worst runs before and after, and the error by region.

    python examples/draw_gap.py out/model.json --out docs/images

These are the pictures of docs/gap.md. They show the study
`python -m sysid.gap examples/gap_logs --model out/model.json`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from mecanum_env.cli import run
from mecanum_env.files import atomic_path
from mecanum_env.model import read_model
from mecanum_env.statistics import rms
from sysid.gap.report.plots import AFTER, BEFORE, COMMAND, MEASURED
from sysid.gap.result import GapOptions, GapReport, Overlay, Region
from sysid.gap.wording import verdict_sentence, worst_channel
from sysid.gap.workflow import analyse
from sysid.logs import read_dataset
from sysid.logs.of_fit import logs_of_fit
from sysid.progress import stage_bar

LOGS = Path(__file__).parent / "gap_logs"
DIMENSIONS = ("phase", "speed", "direction")


def draw(model: tyro.conf.Positional[Path], /, logs: Path = LOGS, out: Path = Path("out/gap")) -> None:
    """Study logs and write gap_runs.png and gap_where.png.

    Args:
        model: Model to compare with the logs, from python -m sysid.fit.
        logs: Folder of bench or robot logs.
        out: Folder to write.
    """
    with stage_bar(5) as progress:
        dataset, base = read_dataset(logs), read_model(model)
        # As the program does, which compares with the logs of the fit where it finds them.
        options = GapOptions(fitted_on=logs_of_fit(base, model.parent, dataset.level)[0])
        report = analyse(dataset, base, options, progress=progress)
    print(verdict_sentence(report))
    for name, figure in (("gap_runs.png", runs_figure(report)), ("gap_where.png", where_figure(report))):
        with atomic_path(out / name) as path:
            figure.savefig(path, dpi=100, format="png", metadata={"Software": None})
        print(f"wrote {out / name}")


def runs_figure(report: GapReport, count: int = 2) -> Any:
    """Return the figure of the worst run of each of `count` command sequences, and its error below."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.8), layout="constrained")
    chosen = _one_of_each(report.overlays, count)
    axes = figure.subplots(2, len(chosen), sharex="col", squeeze=False, height_ratios=(2, 1))
    for (upper, lower), overlay in zip(axes.T, chosen, strict=True):
        if overlay.command is not None:
            upper.step(overlay.time_s, overlay.command, where="post", color=COMMAND, lw=0.8, label="command")
        upper.plot(overlay.time_s, overlay.measured, ".", color=MEASURED, ms=4.0, label="measured")
        for name, values, colour in (("before", overlay.before, BEFORE), ("after", overlay.after, AFTER)):
            error = overlay.measured - values
            label = f"{name}, rms {rms(error):.2g} {overlay.unit}"
            upper.plot(overlay.time_s, values, color=colour, lw=1.2, label=label)
            lower.plot(overlay.time_s, error, color=colour, lw=1.0)
        upper.set_title(f"{overlay.file} ({overlay.split})", fontsize=10, loc="left")
        upper.set_ylabel(f"{overlay.channel} [{overlay.unit}]")
        upper.legend(fontsize=8, frameon=False)
        lower.axhline(0.0, color="#bbbbbb", lw=0.6, zorder=0)
        lower.set_ylabel(f"error [{overlay.unit}]")
        lower.set_xlabel("time [s]")
    return figure


def where_figure(report: GapReport) -> Any:
    """Return the figure of the worst channel's rms error by region, before and after."""
    from matplotlib.figure import Figure

    channel = worst_channel(report)
    difference = report.channels[channel]
    figure = Figure(figsize=(10.0, 3.4), layout="constrained")
    axes = figure.subplots(1, len(DIMENSIONS), sharex=True)
    for ax, dimension in zip(axes, DIMENSIONS, strict=True):
        found = [r for r in report.where if r.channel == channel and r.dimension == dimension]
        found.sort(key=_speed_of if dimension == "speed" else lambda r: r.rms)
        rows = np.arange(len(found))
        # Points, as a bar on a logarithmic axis has no base.
        before, after = [r.rms for r in found], [r.rms_after for r in found]
        ax.hlines(rows, after, before, color="0.8", lw=2.0, zorder=1)
        ax.plot(before, rows, "o", color=BEFORE, label="before")
        ax.plot(after, rows, "o", color=AFTER, label="after")
        ax.set_ylim(-0.6, len(found) - 0.4)
        ax.grid(axis="x", alpha=0.3)
        if difference.noise_floor is not None:
            ax.axvline(difference.noise_floor, color="black", ls=":", lw=1.0, label="noise")
        ax.set_yticks(rows, [f"{r.region}  ({r.share:.0%})" for r in found], fontsize=9)
        ax.set_title(f"by {dimension}", fontsize=10, loc="left")
        ax.set_xscale("log")
        ax.set_xlabel(f"rms error of {channel} [{difference.unit}]", fontsize=9)
    axes[0].legend(fontsize=8, frameon=False, loc="lower right")
    return figure


def _one_of_each(overlays: Sequence[Overlay], count: int) -> list[Overlay]:
    """Return the first overlay of each command sequence, named by the file up to its last "_"."""
    first: dict[str, Overlay] = {}
    for overlay in overlays:
        first.setdefault(overlay.file.rsplit("_", 1)[0], overlay)
    return list(first.values())[:count]


def _speed_of(region: Region) -> float:
    """Return the first number in a region's name; "up to" sorts before it and "above" after it."""
    words = region.region.split()
    number = next(float(word) for word in words if word.replace(".", "", 1).isdigit())
    return number + {"above": 0.5, "up": -0.5}.get(words[0], 0.0)


if __name__ == "__main__":
    sys.exit(run(draw, prog="python examples/draw_gap.py"))
