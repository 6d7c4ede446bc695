"""The charts of the experiment as data, for the page and the PNG files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray
from sysid.studies.reproduce import published
from sysid.studies.reproduce.contenders import CONTENDERS
from sysid.studies.reproduce.experiment import Reproduction
from sysid.studies.reproduce.prediction import Response
from sysid.studies.reproduce.starts import USABLE_RMS_RPM

Style = Literal["line", "points", "stairs", "dashed", "marked"]

COLOURS: Final = {
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


def chart(found: Reproduction, name: str) -> Chart:
    """Return one chart of the results `found` by its name."""
    return next(c for c in charts(found) if c.name == name)


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
        lines.append(Line(CONTENDERS[name].label, x, y, COLOURS[name], "stairs"))
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
        lines.append(Line(CONTENDERS[name].label, shown.tick_s, seen, COLOURS[name]))
    return Panel(
        title or shown.name,
        "time [s]",
        "wheel speed [rpm]",
        tuple(lines),
        x_limits=limits,
        y_limits=(-0.06 * top, 1.14 * top),
    )


def _metric_panels(found: Reproduction) -> tuple[Panel, ...]:
    target = found.target
    speeds = np.array(target.speeds_rpm, float)

    def panel(
        title: str,
        y_label: str,
        measured: FloatArray,
        true: FloatArray,
        values: dict[str, float],
        paper: float,
    ) -> Panel:
        lines = [
            Line("target, measured", speeds, measured, _MEASURED, "marked"),
            Line("target, true", speeds, true, _BLACK, "marked"),
        ]
        lines += [
            Line(CONTENDERS[name].label, speeds, np.full(len(speeds), value), COLOURS[name])
            for name, value in values.items()
            if np.isfinite(value)
        ]
        lines.append(Line("paper's robot, average", speeds[[0, -1]], np.full(2, paper), _BLACK, "dashed"))
        every = np.concatenate([line.y for line in lines])
        low, high = _range(every)
        return Panel(title, "command [rpm]", y_label, tuple(lines), y_limits=(low, high))

    models = {name: found.models[name] for name in _SHOWN}
    return (
        panel(
            "relative steady-state error",
            "error [%]",
            100.0 * target.relative_error,
            100.0 * target.true_relative_error,
            {name: 100.0 * model.relative_error_after_1_s for name, model in models.items()},
            100.0 * published.STEADY_ERROR["target"],
        ),
        panel(
            "rise time, 10 to 90 %",
            "time [s]",
            target.rise_s,
            target.true_rise_s,
            {name: model.rise_s for name, model in models.items()},
            published.RISE_S["target"],
        ),
        panel(
            "settling time, 2 %",
            "time [s]",
            target.settling_s,
            target.true_settling_s,
            {name: model.settling_s for name, model in models.items()},
            published.SETTLING_S["target"],
        ),
    )


def _robot_panels(found: Reproduction) -> tuple[Panel, ...]:
    panels = []
    for moved in found.robot:
        lines = (
            Line("law alone", moved.time_s, moved.law, COLOURS["kkt"]),
            Line("robot on rollers", moved.time_s, moved.body, COLOURS["output-error"]),
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


def _range(values: npt.NDArray[np.float64] | Sequence[float]) -> tuple[float, float]:
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    margin = 0.08 * max(high - low, 1e-6)
    return low - margin, high + margin
