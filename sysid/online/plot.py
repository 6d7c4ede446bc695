"""A picture of one wheel's online identification: speeds, innovations, figures of the law, coefficients."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from mecanum_env.files import atomic_path
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.units import FloatArray
from sysid.online.history import LawMetrics
from sysid.online.replay import WheelHistory

_MOST_POINTS: Final = 4000
_BAND_SIGMAS: Final = 2.0
_COLOURS: Final = ("tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple", "tab:brown")


def save_plot(target: Path, title: str, wheel: WheelHistory, figures: LawMetrics) -> None:
    """Write a PNG with four panels over time; bands are two standard errors.

    Args:
        target: file to write.
        title: shown above the panels.
        wheel: what was known at every tick.
        figures: of the same history.
    """
    history = wheel.history
    time = history.time_s
    every = max(1, -(-len(time) // _MOST_POINTS))
    figure = Figure(figsize=(11.0, 11.0), layout="constrained")
    FigureCanvasAgg(figure)
    speeds, innovations, behaviour, coefficients = figure.subplots(4, 1, sharex=True)
    figure.suptitle(title)

    measured = np.isfinite(history.speed_rpm)
    speeds.plot(time[measured], history.speed_rpm[measured], ".", ms=2, color="0.6", label="measured")
    speeds.plot(
        time[::every], history.predicted_rpm[::every], lw=0.8, label="predicted before it was measured"
    )
    _finish(speeds, "wheel speed [rpm]")

    size = np.maximum(np.abs(history.innovation_rpm[measured]), 1e-2)
    innovations.semilogy(time[measured], size, ".", ms=2, color="0.6", label="|innovation|")
    innovations.semilogy(time[::every], history.noise_rpm[::every], label="its usual standard deviation")
    _finish(innovations, "innovation [rpm]")

    at = time[figures.tick]
    lag, band = 1e3 * figures.mean_lag_s, _BAND_SIGMAS * 1e3 * figures.mean_lag_error_s
    rise = 1e3 * figures.rise_time_s
    behaviour.plot(at, rise, color=_COLOURS[1], label="rise time 10-90 % [ms]")
    behaviour.plot(at, lag, color=_COLOURS[0], label="mean lag [ms], with 2 standard errors")
    behaviour.fill_between(at, lag - band, lag + band, color=_COLOURS[0], alpha=0.2, lw=0)
    behaviour.set_ylim(*_limits(np.concatenate([rise, lag]), from_zero=True))
    pole = behaviour.twinx()
    pole.plot(at, figures.dominant_pole, color=_COLOURS[2], label="largest pole (right)")
    pole.plot(at, figures.dc_gain, ":", color="black", label="DC gain (right)")
    pole.set_ylim(0.0, 1.05)
    _finish(behaviour, "behaviour", also=pole)

    for i, name in enumerate(COEFFICIENTS):
        value, band = history.coefficients[::every, i], _BAND_SIGMAS * history.standard_errors[::every, i]
        coefficients.plot(time[::every], value, color=_COLOURS[i], lw=0.9, label=name)
        coefficients.fill_between(
            time[::every], value - band, value + band, color=_COLOURS[i], alpha=0.15, lw=0
        )
    coefficients.set_ylim(*_limits(history.coefficients.ravel()))
    _finish(coefficients, "coefficients, with 2 standard errors")
    coefficients.set_xlabel("time [s]")

    for start in wheel.run_start[1:]:
        for axes in (speeds, innovations, behaviour, coefficients):
            axes.axvline(time[start], color="0.8", lw=0.6, zorder=0)
    with atomic_path(target) as path:
        figure.savefig(path, dpi=110, metadata={"Software": None})


def _finish(axes: Axes, label: str, also: Axes | None = None) -> None:
    axes.set_ylabel(label)
    axes.margins(x=0.0)
    axes.grid(alpha=0.3)
    handles, labels = axes.get_legend_handles_labels()
    if also is not None:
        more = also.get_legend_handles_labels()
        handles, labels = handles + more[0], labels + more[1]
    axes.legend(
        handles,
        labels,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        borderaxespad=0.2,
        frameon=False,
        fontsize="small",
        ncols=len(labels),
    )


def _limits(values: FloatArray, from_zero: bool = False) -> tuple[float, float]:
    """Return axis limits that hold 98 % of the values, so that the first guesses do not set the scale."""
    values = values[np.isfinite(values)]
    low, high = np.quantile(values, [0.01, 0.99]) if values.size else (0.0, 1.0)
    low = 0.0 if from_zero else low
    margin = 0.15 * max(high - low, 1e-3)
    return float(low if from_zero else low - margin), float(high + 2.0 * margin)
