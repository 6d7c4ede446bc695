"""The fit as one picture: measured against simulated, residuals, poles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mecanum_env.files import atomic_path
from sysid.fit.pipeline import Fit
from sysid.report.worst_runs import RunView, run_views

COLOURS = {"measured": "0.55", "simulated": "#c8102e", "command": "#1f4e79"}


def write_fit_plots(fit: Fit, folder: Path) -> Path:
    """Write `fit.png` into a folder and return its path."""
    views = run_views(fit, most=4)
    figure = Figure(figsize=(13.5, 7.2), layout="constrained")
    axes = figure.subplots(2, 3)
    for ax, view in zip(axes.flat[:4], views, strict=False):
        _overlay(ax, view)
    for ax in axes.flat[len(views) : 4]:
        ax.set_axis_off()
    _residuals(axes.flat[4], fit, views)
    _poles(axes.flat[5], fit)
    figure.suptitle(f"{fit.dataset.name}: measured against the identified law ({fit.estimate.method})")
    path = folder / "fit.png"
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=110)
    return path


def _overlay(ax: Axes, view: RunView) -> None:
    ax.plot(view.time_s, view.measured_rpm, ".", ms=3, color=COLOURS["measured"], label="measured")
    ax.step(view.tick_s, view.command_rpm, where="post", lw=1, color=COLOURS["command"], label="command")
    ax.plot(view.tick_s, view.simulated_rpm, lw=1.5, color=COLOURS["simulated"], label="simulated")
    ax.set(title=f"{view.name} ({view.split}), rms {view.rms_rpm:.2f} rpm", xlabel="time [s]", ylabel="rpm")
    ax.legend(fontsize=8)


def _residuals(ax: Axes, fit: Fit, views: list[RunView]) -> None:
    for view in views:
        ax.plot(view.time_s, view.residual_rpm, lw=0.7, label=f"{view.name} ({view.split})")
    sigma = float(np.mean(list(fit.sigma_rpm.values())))
    ax.axhspan(-2 * sigma, 2 * sigma, color="0.9", zorder=0, label="noise, 2 sigma")
    ax.set(title="measured minus simulated", xlabel="time [s]", ylabel="rpm")
    ax.legend(fontsize=7)


def _poles(ax: Axes, fit: Fit) -> None:
    turn = np.linspace(0, 2 * np.pi, 200)
    ax.plot(np.cos(turn), np.sin(turn), color="0.6", lw=1)
    poles = fit.law.poles
    ax.plot(poles.real, poles.imag, "x", ms=9, mew=2, color=COLOURS["simulated"])
    ax.set(
        title="poles in the unit circle: " + ", ".join(f"{abs(p):.3f}" for p in poles),
        aspect="equal",
        xlim=(-1.15, 1.15),
        ylim=(-1.15, 1.15),
    )
