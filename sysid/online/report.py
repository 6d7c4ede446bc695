"""Results of a replay: a table for the terminal, JSON, and a plot of each wheel."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from mecanum_env.files import atomic_path, plain_json
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.statistics import rms
from mecanum_env.units import FloatArray
from sysid.fit.drive import CommandPath
from sysid.logs import Dataset
from sysid.online.history import LawMetrics, law_metrics
from sysid.online.options import OnlineOptions
from sysid.online.replay import WheelHistory

FORMAT: Final = "mecanum-online-history/1"
_METRIC_TICKS: Final = 400  # metrics are computed at about this many ticks of a replay
_TABLE_ROWS: Final = 10
_MISFIT: Final = 5.0  # innovations above this multiple of the expected noise at the end are reported
_MOST_POINTS: Final = 4000  # largest number of points in a curve of the plot
_BAND_SIGMAS: Final = 2.0
_LEGEND: Final[dict[str, Any]] = {
    "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.2, "frameon": False, "fontsize": "small"
}  # fmt: skip
_COLOURS: Final = ("tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple", "tab:brown")


def report_metrics(wheel: WheelHistory) -> LawMetrics:
    """Return the metrics of a wheel's laws at the ticks that the report shows."""
    return law_metrics(wheel.history, max(1, len(wheel.history.speed_rpm) // _METRIC_TICKS))


def table(wheel: WheelHistory, metrics: LawMetrics) -> str:
    """Return the coefficients, metrics and innovations of one wheel at ten times, for the terminal."""
    history = wheel.history
    rows = np.unique(np.linspace(0, len(metrics.tick) - 1, _TABLE_ROWS + 1).astype(int))[1:]
    names = " ".join(f"{name:>7}" for name in COEFFICIENTS)
    lines = [
        f"{wheel.wheel}: {len(wheel.files)} run(s), {len(history.speed_rpm)} ticks of "
        f"{history.sample_period_s * 1e3:.4g} ms",
        f"{'time s':>8} {names} {'rise ms':>8} {'lag ms':>14} {'pole':>6} {'error rpm':>9}",
    ]
    before = 0
    for row in rows:
        tick = int(metrics.tick[row])
        values = " ".join(f"{value:7.3f}" for value in history.coefficients[tick])
        lag = f"{1e3 * metrics.mean_lag_s[row]:.1f} +- {1e3 * metrics.mean_lag_error_s[row]:.1f}"
        error = rms(history.innovation_rpm[before : tick + 1])
        lines.append(
            f"{history.time_s[tick]:8.2f} {values} {1e3 * metrics.rise_time_s[row]:8.1f} {lag:>14} "
            f"{metrics.dominant_pole[row]:6.3f} {error:9.2f}"
        )
        before = tick + 1
    return "\n".join(lines)


def misfit_note(wheel: WheelHistory, options: OnlineOptions) -> str | None:
    """Return a sentence if the innovations at the end are far above the expected noise, else None."""
    ratio = wheel.history.noise_rpm[-1] / options.noise_rpm
    if ratio <= _MISFIT:
        return None
    return (
        f"{wheel.wheel}: the innovations are still {ratio:.0f} times the expected noise "
        f"({options.noise_rpm:g} rpm): a single law does not describe the wheel, or --noise is too small"
    )


def online_json(
    dataset: Dataset,
    path: CommandPath,
    options: OnlineOptions,
    wheels: Sequence[WheelHistory],
    metrics: Sequence[LawMetrics],
) -> dict[str, Any]:
    """Return the contents of online.json; `metrics` are those of the `wheels`, in the same order."""
    value = {
        "format": FORMAT,
        "dataset": dataset.name,
        "data_sha256": dataset.sha256,
        "notes": path.notes,
        "options": options,
        "wheels": {w.wheel: _wheel_json(w, m) for w, m in zip(wheels, metrics, strict=True)},
    }
    return dict(plain_json(value))


def _wheel_json(wheel: WheelHistory, metrics: LawMetrics) -> dict[str, Any]:
    history, tick = wheel.history, metrics.tick
    errors = history.standard_errors[tick]
    return {
        "files": wheel.files,
        "run_start_s": [history.time_s[start] for start in wheel.run_start],
        "law": history.law(-1),
        "standard_errors": dict(zip(COEFFICIENTS, errors[-1], strict=True)),
        "innovation_rms_rpm": rms(history.innovation_rpm),
        "history": {
            "time_s": history.time_s[tick],
            "noise_rpm": history.noise_rpm[tick],
            "coefficients": history.coefficients[tick],
            "standard_errors": errors,
            "rise_time_s": metrics.rise_time_s,
            "mean_lag_s": metrics.mean_lag_s,
            "mean_lag_error_s": metrics.mean_lag_error_s,
            "dominant_pole": metrics.dominant_pole,
            "dc_gain": metrics.dc_gain,
        },
    }


def save_plot(target: Path, title: str, wheel: WheelHistory, metrics: LawMetrics) -> None:
    """Write a PNG with a `title` and four panels over time; bands are two standard errors."""
    history = wheel.history
    time = history.time_s
    every = max(1, -(-len(time) // _MOST_POINTS))
    figure = Figure(figsize=(11.0, 11.0), layout="constrained")
    FigureCanvasAgg(figure)
    speeds, innovations, behaviour, coefficients = figure.subplots(4, 1, sharex=True)
    figure.suptitle(title)

    measured = np.isfinite(history.speed_rpm)
    speeds.plot(time[measured], history.speed_rpm[measured], ".", ms=2, color="0.6", label="measured")
    predicted = history.predicted_rpm[::every]
    speeds.plot(time[::every], predicted, lw=0.8, label="predicted before the measurement")
    _finish(speeds, "wheel speed [rpm]")

    size = np.maximum(np.abs(history.innovation_rpm[measured]), 1e-2)
    innovations.semilogy(time[measured], size, ".", ms=2, color="0.6", label="|innovation|")
    innovations.semilogy(time[::every], history.noise_rpm[::every], label="its usual standard deviation")
    _finish(innovations, "innovation [rpm]")

    at = time[metrics.tick]
    lag, band = 1e3 * metrics.mean_lag_s, _BAND_SIGMAS * 1e3 * metrics.mean_lag_error_s
    rise = 1e3 * metrics.rise_time_s
    behaviour.plot(at, rise, color=_COLOURS[1], label="rise time 10-90 % [ms]")
    behaviour.plot(at, lag, color=_COLOURS[0], label="mean lag [ms], with 2 standard errors")
    behaviour.fill_between(at, lag - band, lag + band, color=_COLOURS[0], alpha=0.2, lw=0)
    behaviour.set_ylim(*_limits(np.concatenate([rise, lag]), from_zero=True))
    pole = behaviour.twinx()
    pole.plot(at, metrics.dominant_pole, color=_COLOURS[2], label="largest pole (right)")
    pole.plot(at, metrics.dc_gain, ":", color="black", label="DC gain (right)")
    pole.set_ylim(0.0, 1.05)
    _finish(behaviour, "metrics of the law", second=pole)

    for i, (name, colour) in enumerate(zip(COEFFICIENTS, _COLOURS, strict=True)):
        value, band = history.coefficients[::every, i], _BAND_SIGMAS * history.standard_errors[::every, i]
        coefficients.plot(time[::every], value, color=colour, lw=0.9, label=name)
        coefficients.fill_between(time[::every], value - band, value + band, color=colour, alpha=0.15, lw=0)
    coefficients.set_ylim(*_limits(history.coefficients.ravel()))
    _finish(coefficients, "coefficients, with 2 standard errors")
    coefficients.set_xlabel("time [s]")

    for start in wheel.run_start[1:]:
        for axes in (speeds, innovations, behaviour, coefficients):
            axes.axvline(time[start], color="0.8", lw=0.6, zorder=0)
    with atomic_path(target) as path:
        figure.savefig(path, dpi=110, metadata={"Software": None})


def _finish(axes: Axes, label: str, second: Axes | None = None) -> None:
    """Label a panel, with one legend above it for both of its axes."""
    axes.set_ylabel(label)
    axes.margins(x=0.0)
    axes.grid(alpha=0.3)
    handles, labels = axes.get_legend_handles_labels()
    if second is not None:
        more = second.get_legend_handles_labels()
        handles, labels = handles + more[0], labels + more[1]
    axes.legend(handles, labels, loc="lower right", ncols=len(labels), **_LEGEND)


def _limits(values: FloatArray, from_zero: bool = False) -> tuple[float, float]:
    """Return axis limits that contain 98 % of the values, so that the first guesses do not set the scale."""
    values = values[np.isfinite(values)]
    low, high = np.quantile(values, [0.01, 0.99]) if values.size else (0.0, 1.0)
    low = 0.0 if from_zero else low
    margin = 0.15 * max(high - low, 1e-3)
    return float(low if from_zero else low - margin), float(high + 2.0 * margin)
