"""The pictures of the experiment as PNG files."""

from __future__ import annotations

import math
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mecanum_env.files import atomic_path
from sysid.reproduce.charts import Chart, Line, Panel, charts
from sysid.reproduce.experiment import Reproduction

_PANEL_INCHES = (4.6, 3.0)
_WIDE_INCHES = (8.0, 4.2)


def write_reproduction_plots(found: Reproduction, folder: Path) -> list[Path]:
    """Write every chart as PNG into a folder and return the paths.

    Args:
        found: the experiment.
        folder: made where it is missing.
    """
    return [_write(chart, folder / f"{chart.name}.png") for chart in charts(found)]


def _write(chart: Chart, path: Path) -> Path:
    rows = math.ceil(len(chart.panels) / chart.columns)
    width, height = _WIDE_INCHES if len(chart.panels) == 1 else _PANEL_INCHES
    figure = Figure(figsize=(width * chart.columns, height * rows + 0.5), layout="constrained")
    axes = list(figure.subplots(rows, chart.columns, squeeze=False).flat)
    for ax, panel in zip(axes, chart.panels, strict=False):
        _draw(ax, panel)
    for ax in axes[len(chart.panels) :]:
        ax.set_axis_off()
    handles = {
        label: handle for ax in axes for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        handles.values(), handles.keys(), loc="outside lower center", ncols=2 * chart.columns + 1, fontsize=8
    )
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=80)
    return path


def _draw(ax: Axes, panel: Panel) -> None:
    for line in panel.lines:
        _add(ax, line)
    ax.set_title(panel.title, fontsize=10)
    ax.set(xlabel=panel.x_label, ylabel=panel.y_label)
    if panel.log_x:
        ax.set_xscale("log")
    if panel.x_limits:
        ax.set_xlim(panel.x_limits)
    if panel.y_limits:
        ax.set_ylim(panel.y_limits)


def _add(ax: Axes, line: Line) -> None:
    if line.style == "stairs":
        ax.step(line.x, line.y, where="post", lw=1.1, color=line.colour, label=line.label)
    elif line.style == "points":
        ax.plot(line.x, line.y, ".", ms=3, color=line.colour, label=line.label)
    else:
        form = {"dashed": "--", "marked": "o-", "line": "-"}[line.style]
        ax.plot(line.x, line.y, form, ms=3, lw=1.3, color=line.colour, label=line.label)
