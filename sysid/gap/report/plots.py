"""Figures of a gap study's page: the worst runs, the error by region, and the next experiment."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from mecanum_env.report import figure
from mecanum_env.statistics import rms
from sysid.gap.result import Experiment, GapReport, Overlay, Region
from sysid.gap.wording import number
from sysid.logs.runs import UNITS

MEASURED, BEFORE, AFTER, COMMAND = "#8a8a8a", "#c8102e", "#0b7a75", "#1f4e79"
_CANDIDATES: Final = ("#0b7a75", "#c8102e", "#1f4e79", "#c58b00", "#6b4c9a")
"""Line colours of the candidates, in their order."""
_HEAT: Final = [[0.0, "#fbfaf7"], [0.15, "#fdeccb"], [0.4, "#f7b267"], [0.7, "#d1495b"], [1.0, "#6d1a36"]]
_COMMANDS: Final = (COMMAND, "#c58b00", "#6b4c9a", "#4d8076")
"""Line colours of the command columns, in their order."""
_ROW_PX, _MOST_PANELS = 24, 3
_PALE: Final = 4.0
"""Least error that the darkest colour stands for, so that noise alone stays pale."""
_DIMENSIONS: Final = ("phase", "speed", "direction", "time", "heading", "battery", "repeat")
_REGIONS: Final = (
    *("rest", "start", "rising", "steady", "falling", "reversal", "coasting"),
    *("at rest", "forward", "backward", "left", "right", "diagonal", "turning", "mixed"),
    *("early", "middle", "late"),
    *("towards +x", "towards +y", "towards -x", "towards -y", "on the spot"),
)
"""Order in which regions are listed; those with numbers are ordered by their numbers."""
_HEAT_SIDES_PX, _HEAT_CELL_PX = 260, 38
"""Width of what stands beside the cells of a heat map, and the least width of a cell."""

Figure = dict[str, Any]


def overlay_figure(overlay: Overlay) -> Figure:
    """Return a run as measured and simulated, and below it measured minus simulated."""
    changed = not np.allclose(overlay.before, overlay.after, equal_nan=True)
    traces = [
        _line(
            overlay.time_s,
            overlay.measured,
            "measured",
            MEASURED,
            mode="markers",
            marker={"size": 3, "color": MEASURED},
        )
    ]
    if overlay.command is not None:
        traces.append(_line(overlay.time_s, overlay.command, "command", COMMAND, width=1.0, shape="hv"))
    simulated = [("before" if changed else "simulated", overlay.before, BEFORE)]
    simulated += [("after", overlay.after, AFTER)] if changed else []
    errors = []
    for name, values, colour in simulated:
        error = overlay.measured - values
        traces.append(_line(overlay.time_s, values, name, colour))
        traces.append(_line(overlay.time_s, error, name, colour, width=1.0, yaxis="y2", showlegend=False))
        errors.append(number(rms(error)))
    return figure(
        traces,
        title=f"{overlay.file} ({overlay.split}), {overlay.channel}: rms {' → '.join(errors)} {overlay.unit}",
        x="time [s]",
        y=overlay.unit,
        height=400,
        layout={
            "xaxis": {"title": {"text": "time [s]"}, "zeroline": False, "anchor": "y2"},
            "yaxis": {"title": {"text": overlay.unit}, "zeroline": False, "domain": [0.36, 1.0]},
            "yaxis2": {"title": {"text": "error"}, "zerolinecolor": "#bbb", "domain": [0.0, 0.26]},
        },
    )


def heat_figure(report: GapReport) -> Figure | None:
    """Return the error of regions (rows) by channels (columns), before and after on one colour scale.

    Errors are in units of `heat_scale`. If nothing was added to the model there is no second half; without
    regions there is no figure.
    """
    rows = _rows(report.where)
    if not rows:
        return None
    scale, unit = heat_scale(report)
    wide = min(0.48, 0.16 + 0.08 * len(scale))
    halves = [("before", 0.0, wide)]
    if report.changed:
        halves.append(("after", wide + 0.04, 2.0 * wide + 0.04))
    layout: dict[str, Any] = {
        "yaxis": {"autorange": "reversed", "automargin": True, "dtick": 1, "anchor": "x"},
        "yaxis2": {"matches": "y", "showticklabels": False, "ticks": "", "anchor": "x2"},
        "margin": {"l": 150, "r": 20, "t": 40, "b": 80},
        "shapes": [_rule(i, halves[-1][2]) for i in range(1, len(rows)) if rows[i][0] != rows[i - 1][0]],
        "annotations": [],
    }
    traces = []
    for (name, left, right), axis in zip(halves, ("", "2"), strict=False):
        trace = _heat(report, rows, scale, after=name == "after")
        trace["hovertemplate"] = (
            "%{y}<br>%{x}: %{text} " + unit + " " + name + "<br>%{customdata}<extra></extra>"
        )
        traces.append({**trace, "xaxis": f"x{axis}", "yaxis": f"y{axis}"})
        layout[f"xaxis{axis}"] = {"domain": [left, right], "anchor": f"y{axis}", "tickangle": -30}
        layout["annotations"].append(_caption(name, 0.5 * (left + right)))
    worst = max((cell for row in traces[0]["z"] for cell in row if cell is not None), default=0.0)
    layout["coloraxis"] = {
        "colorscale": _HEAT, "cmin": 0.0, "cmax": max(worst, _PALE),
        "colorbar": {"title": {"text": unit}, "thickness": 12, "len": 0.9, "x": halves[-1][2] + 0.01},
    }  # fmt: skip
    return figure(traces, height=130 + _ROW_PX * len(rows), layout=layout)


def heat_width_px(report: GapReport) -> int:
    """Return the least width [px] at which the numbers of `heat_figure` have room in their cells."""
    columns = len(heat_scale(report)[0]) * (2 if report.changed else 1)
    return _HEAT_SIDES_PX + _HEAT_CELL_PX * columns


def _heat(
    report: GapReport, rows: Sequence[tuple[str, str]], scale: Mapping[str, float], *, after: bool
) -> dict[str, Any]:
    channels = [name for name in UNITS if name in scale]
    regions = {(r.channel, r.dimension, r.region): r for r in report.where}
    found = [[regions.get((channel, *row)) for channel in channels] for row in rows]

    def table(of: Callable[[Region], Any], empty: Any) -> list[list[Any]]:
        return [[empty if region is None else of(region) for region in row] for row in found]

    def error(region: Region) -> float:
        return (region.rms_after if after else region.rms) / scale[region.channel]

    return {
        "type": "heatmap",
        "x": channels,
        "y": [name if name.startswith(dimension) else f"{dimension} · {name}" for dimension, name in rows],
        "z": table(error, None),
        "text": table(lambda r: f"{error(r):.2g}" if error(r) < 100.0 else f"{error(r):.0f}", ""),
        "customdata": table(lambda r: f"{r.share:.0%} of the error, {r.samples} samples", ""),
        "texttemplate": "%{text}",
        "textfont": {"size": 11},
        "coloraxis": "coloraxis",
        "xgap": 2,
        "ygap": 2,
    }


def _rule(row: int, right: float) -> dict[str, Any]:
    """Return the line above a row, up to the right end."""
    place = {"xref": "paper", "x0": 0, "x1": right, "y0": row - 0.5, "y1": row - 0.5}
    return {"type": "line", **place, "line": {"color": "#999", "width": 1}}


def _caption(text: str, middle: float) -> dict[str, Any]:
    place = {"x": middle, "y": 1.0, "xref": "paper", "yref": "paper", "xanchor": "center"}
    return {"text": f"<b>{text}</b>", **place, "yanchor": "bottom", "yshift": 8, "showarrow": False}


def heat_scale(report: GapReport) -> tuple[dict[str, float], str]:
    """Return the unit of the heat map in each channel, and its name.

    It is the noise if that is known for every channel, else the channel's error before.
    """
    floors = {name: channel.noise_floor for name, channel in report.channels.items()}
    names = {region.channel for region in report.where}
    if all((floors.get(name) or 0.0) > 0.0 for name in names):
        return {name: floors[name] or 1.0 for name in names}, "sigma"
    scale = {}
    for name in names:
        before = report.channels[name].before if name in report.channels else 0.0
        scale[name] = before if before > 0.0 else 1.0
    return scale, "of the mean error"


def experiment_figure(experiment: Experiment) -> Figure:
    """Return the commands of the next experiment, and below them what each candidate predicts."""
    end = experiment.duration_s
    commands = [
        _line([*experiment.time_s, end], [*values, values[-1]], name, colour, shape="hv")
        for (name, values), colour in zip(experiment.columns.items(), _COMMANDS, strict=False)
    ]
    channels = [] if experiment.predicted_time_s is None else _most_different(experiment)
    panels = [("command", commands)]
    panels += [(name, _predictions(experiment, name, legend=name == channels[0])) for name in channels]
    traces: list[dict[str, Any]] = []
    layout: dict[str, Any] = {}
    share = 1.0 / len(panels)
    for i, (name, lines) in enumerate(panels):
        axis = "" if i == 0 else str(i + 1)
        top = 1.0 - i * share
        title = f"{name} [{UNITS[name]}]" if name in UNITS else "command"
        layout[f"yaxis{axis}"] = {
            "domain": [top - share * 0.82, top], "title": {"text": title}, "zeroline": False,
        }  # fmt: skip
        traces += [{**line, "yaxis": f"y{axis}"} for line in lines]
    last = "" if len(panels) == 1 else str(len(panels))
    layout["xaxis"] = {"title": {"text": "time [s]"}, "anchor": f"y{last}", "zeroline": False}
    return figure(traces, height=110 + 190 * len(panels), layout=layout)


def _most_different(experiment: Experiment) -> list[str]:
    """Return the channels in which the predictions differ most, relative to their range."""
    predicted = list(experiment.predicted.values())
    shared = [name for name in UNITS if predicted and all(name in p for p in predicted)]

    def difference(name: str) -> float:
        values = np.array([p[name] for p in predicted])
        span = float(np.nanmax(values) - np.nanmin(values))
        return float(np.nanmax(np.ptp(values, axis=0))) / span if span > 0.0 else 0.0

    return sorted(shared, key=lambda name: -difference(name))[:_MOST_PANELS]


def _predictions(experiment: Experiment, channel: str, *, legend: bool) -> list[dict[str, Any]]:
    time = experiment.predicted_time_s
    return [
        _line(time, values[channel], name, colour, showlegend=legend, legendgroup=name)
        for (name, values), colour in zip(experiment.predicted.items(), _CANDIDATES, strict=False)
    ]


def _rows(where: Sequence[Region]) -> list[tuple[str, str]]:
    """Return (dimension, region) in reading order, without wheels: they are columns."""
    pairs = {(region.dimension, region.region) for region in where if region.dimension != "wheel"}
    return sorted(pairs, key=lambda pair: (_place(_DIMENSIONS, pair[0]), *_reading_order(pair[1])))


def _reading_order(region: str) -> tuple[int, int, float, str]:
    numbers = re.findall(r"\d+(?:\.\d+)?", region)
    first = float(numbers[0]) if numbers else 0.0
    # "up to 20" stands before "20 .. 40".
    return _place(_REGIONS, region), int(bool(numbers)), first - 0.5 * region.startswith("up to"), region


def _place(order: Sequence[str], name: str) -> int:
    return order.index(name) if name in order else len(order)


def _line(
    x: Any, y: Any, name: str, colour: str, *, width: float = 1.6, shape: str = "linear", **more: Any
) -> dict[str, Any]:
    values = [None if not np.isfinite(value) else float(value) for value in y]
    line = {"color": colour, "width": width, "shape": shape}
    base = {"type": "scatter", "mode": "lines", "line": line, "name": name}
    return {**base, "x": np.asarray(x, float).tolist(), "y": values, **more}
