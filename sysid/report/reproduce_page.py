"""The page of the experiment."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any, Final

import numpy as np

import mecanum_env
from mecanum_env.report import figure, report_available, write_page
from mecanum_env.units import FloatArray
from sysid.reproduce.chapters import chapters
from sysid.reproduce.charts import Line, Panel, charts
from sysid.reproduce.experiment import Reproduction
from sysid.reproduce.tables import verdict

_TEMPLATE: Final = Path(__file__).parent / "templates" / "reproduce.html"
_STYLE: Final[dict[str, dict[str, Any]]] = {
    "line": {"mode": "lines", "line": {"width": 1.6}},
    "stairs": {"mode": "lines", "line": {"width": 1.4, "shape": "hv"}},
    "dashed": {"mode": "lines", "line": {"width": 1.2, "dash": "dash"}},
    "points": {"mode": "markers", "marker": {"size": 3}},
    "marked": {"mode": "lines+markers", "line": {"width": 1.2}, "marker": {"size": 5}},
}


def write_reproduction_page(found: Reproduction, path: Path) -> bool:
    """Write the page; return False, writing nothing, where the `report` extra is not installed.

    Args:
        found: the experiment.
        path: of the page.
    """
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
    # Five digits are more than a screen shows, and keep the page small.
    return [float(f"{value:.5g}") if np.isfinite(value) else None for value in values.tolist()]
