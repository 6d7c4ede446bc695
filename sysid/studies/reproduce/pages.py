"""The results of the experiment as a page, as Markdown and as PNG files, all in the same chapters."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import mecanum_env
from mecanum_env.files import atomic_path
from mecanum_env.report import figure, report_available, write_page
from mecanum_env.units import FloatArray
from sysid.studies.reproduce import tables
from sysid.studies.reproduce.charts import Chart, Line, Panel, charts
from sysid.studies.reproduce.experiment import Reproduction
from sysid.studies.reproduce.tables import Table, comparison_table, verdict


@dataclass(frozen=True)
class Chapter:
    """One part of the results."""

    title: str
    text: str
    charts: tuple[str, ...]
    """Names in `charts`."""
    tables: tuple[Table, ...]


def chapters(found: Reproduction) -> list[Chapter]:
    """Return the results in the order of the paper."""
    return [
        Chapter(
            "Success and stability from random starts (section 4.1)",
            "Every gradient method descends from the same random starts. The paper reports 10; more show "
            "how certain that is. The curves show all thresholds at once: how large a share of the starts "
            "ends with an rms at or below each value.",
            ("starts",),
            (
                tables.starts_table(found),
                tables.fates_table(found),
                comparison_table(found, "starts"),
                tables.law_table(found),
            ),
        ),
        Chapter(
            "Step responses (Fig. 3) and their metrics (Fig. 4)",
            "The test steps took no part in any fit.",
            ("fig3-steps", "fig4-metrics"),
            (
                tables.metric_table(found),
                comparison_table(found, "metrics"),
                tables.speed_table(found),
                tables.error_table(found),
            ),
        ),
        Chapter(
            "Beyond the linear range (Fig. 5)",
            "No linear law has a ceiling. Limiting its command adds one; output error can also estimate it.",
            ("fig5-beyond",),
            (comparison_table(found, "beyond"),),
        ),
        Chapter(
            "Random inputs (Table 1, Fig. 6)",
            "Five trials of 5.2 s: five holds longer than the drive settles and five shorter, in random "
            "order.",
            ("fig6-random",),
            (tables.trial_table(found), comparison_table(found, "trials")),
        ),
        Chapter(
            "Time and memory (Table 2)",
            "",
            (),
            (tables.cost_table(found), comparison_table(found, "cost")),
        ),
        Chapter(
            "The robot (Fig. 7)",
            "The wheel that output error identified, four times, under the robot on its rollers in MuJoCo: "
            "rest, 3 s of the command, stop. The paper measured a real robot; its losses are effects that "
            "a free wheel does not have, so a simulation without them must lose less.",
            ("fig7-robot",),
            (tables.robot_table(found), comparison_table(found, "robot")),
        ),
    ]


def reproduction_markdown(found: Reproduction, pictures: str) -> str:
    """Return all results as Markdown; `pictures` is the folder of the PNG files, relative to it."""
    parts = [
        "# Results of `python -m sysid.studies.reproduce`",
        f"Written by the command itself (seed {found.seed}, {found.effort.starts} starts); do not edit. "
        "What it does: [Reproducing the paper](../reproduce.md).",
        verdict(found),
    ]
    for chapter in chapters(found):
        parts += [f"## {chapter.title}", chapter.text]
        parts += [f"![{name}]({pictures}/{name}.png)" for name in chapter.charts]
        for table in chapter.tables:
            parts += [f"### {table.title}", table.markdown(), table.note]
    return "\n\n".join(part for part in parts if part) + "\n"


_TEMPLATE: Final = Path(__file__).with_name("page.html")
_STYLE: Final[dict[str, dict[str, Any]]] = {
    "line": {"mode": "lines", "line": {"width": 1.6}},
    "stairs": {"mode": "lines", "line": {"width": 1.4, "shape": "hv"}},
    "dashed": {"mode": "lines", "line": {"width": 1.2, "dash": "dash"}},
    "points": {"mode": "markers", "marker": {"size": 3}},
    "marked": {"mode": "lines+markers", "line": {"width": 1.2}, "marker": {"size": 5}},
}


def write_reproduction_page(found: Reproduction, path: Path) -> bool:
    """Write the page; return False without writing if the `report` extra is not installed."""
    if not report_available():
        return False
    figures: dict[str, dict[str, Any]] = {}
    grids: dict[str, tuple[int, list[str]]] = {}
    for chart in charts(found):
        names = [f"{chart.name}-{i}" for i in range(len(chart.panels))]
        figures.update(zip(names, (_panel(panel) for panel in chart.panels), strict=True))
        grids[chart.name] = (chart.columns, names)
    write_page(
        path,
        _TEMPLATE,
        figures,
        verdict=verdict(found),
        chapters=chapters(found),
        grids=grids,
        provenance=f"mecanum-tankendo {mecanum_env.__version__}, seed {found.seed}",
    )
    return True


def _panel(panel: Panel) -> dict[str, Any]:
    axes: dict[str, Any] = {
        "xaxis": {"title": {"text": panel.x_label}, "zeroline": False},
        "yaxis": {"title": {"text": panel.y_label}, "zeroline": False},
        "legend": {"orientation": "h", "y": -0.25, "font": {"size": 10}},
    }
    if panel.log_x:
        axes["xaxis"]["type"] = "log"
    if panel.x_limits:
        axes["xaxis"]["range"] = list(np.log10(panel.x_limits) if panel.log_x else panel.x_limits)
    if panel.y_limits:
        axes["yaxis"]["range"] = list(panel.y_limits)
    return figure([_trace(line) for line in panel.lines], title=panel.title, height=380, layout=axes)


def _trace(line: Line) -> dict[str, Any]:
    style = copy.deepcopy(_STYLE[line.style])
    for key in ("line", "marker"):
        if key in style:
            style[key]["color"] = line.colour
    return {"type": "scatter", "x": _numbers(line.x), "y": _numbers(line.y), "name": line.label, **style}


def _numbers(values: FloatArray) -> list[float | None]:
    # Five digits are more than a screen shows and keep the page small.
    return [float(f"{value:.5g}") if np.isfinite(value) else None for value in values.tolist()]


_PANEL_INCHES = (4.6, 3.0)
_WIDE_INCHES = (8.0, 4.2)


def write_reproduction_plots(found: Reproduction, folder: Path) -> list[Path]:
    """Write every chart as PNG into a folder, created if it is missing, and return the paths."""
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
