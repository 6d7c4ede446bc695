"""The charts of the experiment as data, and their drawing: for the page by Plotly, as PNG by Matplotlib."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mecanum_env.files import atomic_path
from mecanum_env.report import figure
from mecanum_env.units import FloatArray
from sysid.studies.reproduce import published
from sysid.studies.reproduce.contenders import CONTENDERS, USABLE_RMS_RPM
from sysid.studies.reproduce.experiment import Reproduction
from sysid.studies.reproduce.prediction import Response

Style = Literal["line", "points", "stairs", "dashed", "marked"]

_COLOURS: Final = {
    "output-error": "#c8102e",
    "kkt-improved": "#1f4e79",
    "kkt": "#4a90c2",
    "gradient": "#e08a00",
    "poles": "#7b4fa3",
    "gradient-adaptive": "#f0c070",
    "kkt-adaptive": "#9cc4e4",
    "poles-adaptive": "#c3a6dc",
    "exhaustive": "#2e8b57",
    "one-step": "#8c6d31",
}
_MEASURED, _COMMAND, _BLACK = "#9a9a9a", "#555555", "#000000"
_SHOWN: Final = ("gradient", "kkt", "exhaustive", "output-error")
"""The paper's three models and ours, in the order of drawing."""
_STEP_LIMITS: Final = (0.05, 0.6)


@dataclass(frozen=True, eq=False)
class Line:
    """One curve of a panel; x and y have one common shape (n,)."""

    label: str
    x: FloatArray
    y: FloatArray
    colour: str
    style: Style = "line"


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes."""

    title: str
    x_label: str
    y_label: str
    lines: tuple[Line, ...]
    log_x: bool = False
    x_limits: tuple[float, float] | None = None
    y_limits: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Chart:
    """Panels that are shown together."""

    name: str
    """File name and element id."""
    panels: tuple[Panel, ...]
    columns: int


def charts(found: Reproduction) -> list[Chart]:
    """Return all charts in the order of the page."""
    return [
        Chart("starts", (_starts_panel(found),), 1),
        Chart("fig3-steps", tuple(_response_panel(shown, limits=_STEP_LIMITS) for shown in found.shown), 3),
        Chart("fig4-metrics", _metric_panels(found), 3),
        Chart(
            "fig5-beyond",
            (
                _response_panel(found.beyond, "140 rpm, commands as they are", _STEP_LIMITS),
                _response_panel(found.beyond_limited, "140 rpm, commands limited to 135 rpm", _STEP_LIMITS),
            ),
            2,
        ),
        Chart("fig6-random", tuple(_response_panel(trial) for trial in found.trials), 2),
        Chart("fig7-robot", _robot_panels(found), 3),
    ]


def _starts_panel(found: Reproduction) -> Panel:
    lines = []
    count = 1
    for name, rates in reversed(list(found.many_starts.items())):
        count = rates.starts
        x = np.clip(rates.rms_rpm, 0.1, 1e3)
        # The empirical distribution: at each rms, the share of starts that reached it.
        y = np.arange(1, count + 1) / count
        x, y = np.concatenate([[0.1], x, [1e3]]), np.concatenate([[0.0], y, y[-1:]])
        within = x < 1e3
        y[~within] = y[within][-1]
        lines.append(Line(CONTENDERS[name].label, x, y, _COLOURS[name], "stairs"))
    for value, label in ((found.best_rms_rpm * 1.05, "success"), (USABLE_RMS_RPM, "usable")):
        lines.append(Line(label, np.full(2, value), np.array([0.0, 1.0]), _BLACK, "dashed"))
    return Panel(
        f"where {count} random starts end",
        "rms on the fitted data [rpm]",
        "share of starts at or below",
        tuple(lines),
        log_x=True,
        x_limits=(0.4, 300.0),
        y_limits=(-0.02, 1.04),
    )


def _response_panel(shown: Response, title: str = "", limits: tuple[float, float] | None = None) -> Panel:
    top = float(np.max(shown.command_rpm))
    lines = [
        Line("measured", shown.time_s, shown.measured_rpm, _MEASURED, "points"),
        Line("command", shown.tick_s, shown.command_rpm, _COMMAND, "stairs"),
    ]
    for name in _SHOWN:
        speed = shown.models_rpm[name]
        seen = np.where(np.abs(speed) <= 10.0 * top, speed, np.nan)  # An unstable law leaves the chart.
        lines.append(Line(CONTENDERS[name].label, shown.tick_s, seen, _COLOURS[name]))
    return Panel(
        title or shown.name,
        "time [s]",
        "wheel speed [rpm]",
        tuple(lines),
        x_limits=limits,
        y_limits=(-0.06 * top, 1.14 * top),
    )


def _metric_panels(found: Reproduction) -> tuple[Panel, ...]:
    target, panels = found.target, []
    speeds = np.array(target.speeds_rpm, float)
    error = "relative steady-state error"
    # Title, label, metric of the target and of a law, numbers of the paper, and factor to the unit drawn.
    for title, y_label, of_target, of_law, printed, factor in (
        (error, "error [%]", "relative_error", "relative_error_after_1_s", published.STEADY_ERROR, 100.0),
        ("rise time, 10 to 90 %", "time [s]", "rise_s", "rise_s", published.RISE_S, 1.0),
        ("settling time, 2 %", "time [s]", "settling_s", "settling_s", published.SETTLING_S, 1.0),
    ):
        measured, true = (factor * getattr(target, f"{kind}{of_target}") for kind in ("", "true_"))
        lines = [
            Line("target, measured", speeds, measured, _MEASURED, "marked"),
            Line("target, true", speeds, true, _BLACK, "marked"),
        ]
        for name in _SHOWN:
            value = factor * getattr(found.models[name], of_law)
            if np.isfinite(value):
                lines.append(
                    Line(CONTENDERS[name].label, speeds, np.full(len(speeds), value), _COLOURS[name])
                )
        average = np.full(2, factor * printed["target"])
        lines.append(Line("paper's robot, average", speeds[[0, -1]], average, _BLACK, "dashed"))
        every = np.concatenate([line.y for line in lines])
        low, high = float(np.nanmin(every)), float(np.nanmax(every))
        margin = 0.08 * max(high - low, 1e-6)
        limits = (low - margin, high + margin)
        panels.append(Panel(title, "command [rpm]", y_label, tuple(lines), y_limits=limits))
    return tuple(panels)


def _robot_panels(found: Reproduction) -> tuple[Panel, ...]:
    panels = []
    for moved in found.robot:
        lines = (
            Line("law alone", moved.time_s, moved.law, _COLOURS["kkt"]),
            Line("robot on rollers", moved.time_s, moved.body, _COLOURS["output-error"]),
            Line(
                "steady speed with the paper's loss",
                moved.time_s[[0, -1]],
                np.full(2, moved.commanded * (1.0 - moved.paper_loss)),
                _BLACK,
                "dashed",
            ),
        )
        panels.append(Panel(moved.name, "time [s]", f"speed [{moved.unit}]", lines))
    return tuple(panels)


_STYLE: Final[dict[str, dict[str, Any]]] = {
    "line": {"mode": "lines", "line": {"width": 1.6}},
    "stairs": {"mode": "lines", "line": {"width": 1.4, "shape": "hv"}},
    "dashed": {"mode": "lines", "line": {"width": 1.2, "dash": "dash"}},
    "points": {"mode": "markers", "marker": {"size": 3}},
    "marked": {"mode": "lines+markers", "line": {"width": 1.2}, "marker": {"size": 5}},
}


def page_figure(panel: Panel) -> dict[str, Any]:
    """Return a panel as a Plotly figure."""
    axes: dict[str, Any] = {
        "xaxis": {"title": {"text": panel.x_label}, "zeroline": False},
        "yaxis": {"title": {"text": panel.y_label}, "zeroline": False},
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
        look: dict[str, Any] = {"color": line.colour, "label": line.label}
        if line.style == "stairs":
            ax.step(line.x, line.y, where="post", lw=1.1, **look)
        elif line.style == "points":
            ax.plot(line.x, line.y, ".", ms=3, **look)
        else:
            form = {"dashed": "--", "marked": "o-", "line": "-"}[line.style]
            ax.plot(line.x, line.y, form, ms=3, lw=1.3, **look)
    ax.set_title(panel.title, fontsize=10)
    ax.set(xlabel=panel.x_label, ylabel=panel.y_label)
    if panel.log_x:
        ax.set_xscale("log")
    if panel.x_limits:
        ax.set_xlim(panel.x_limits)
    if panel.y_limits:
        ax.set_ylim(panel.y_limits)
