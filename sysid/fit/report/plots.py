"""The runs that a fit's report shows, a replay of the worst one in MuJoCo, and the picture `fit.png`."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mecanum_env.files import atomic_path
from mecanum_env.model import Model
from mecanum_env.simulator.bench import replay_bench
from mecanum_env.statistics import rms
from mecanum_env.units import FloatArray
from sysid.fit.pipeline import Fit
from sysid.fit.report.stated import speeds_with_effects
from sysid.fit.statistics import residual, simulate
from sysid.logs import Split

HELD_OUT_FIRST: Final[tuple[Split, ...]] = ("test", "validation", "fit")
_TITLE_LETTERS: Final = 44
"""Letters of the title's size that one of the six plots is wide."""
_COLOURS: Final = {
    **{"measured": "0.55", "simulated": "#c8102e", "command": "#1f4e79"},
    "with effects": "#2a8c3c",
}


@dataclass(frozen=True)
class BenchReplay:
    """One bench run replayed on the free wheel in MuJoCo and with the law alone."""

    name: str
    measured_rms_rpm: float
    """Measured minus MuJoCo."""
    law_measured_rms_rpm: float
    """Measured minus the law."""
    servo_rms_rpm: float
    """MuJoCo minus the law: the error of the servo between law and wheel."""
    servo_max_rpm: float


def replay_worst(fit: Fit, model: Model) -> BenchReplay | None:
    """Replay the held-out bench run that a fit predicts worst with its model; None for robot logs."""
    if fit.dataset.level != "bench":
        return None
    split = next(split for split in HELD_OUT_FIRST if fit.pooled(split))
    data = max(fit.pooled(split), key=lambda run: rms(residual(run, fit.estimate)))
    log = next(run for run in fit.dataset.runs if run.file == data.name)
    samples = data.sample_tick * data.sample_period_s
    found = fit.estimate
    ticks = simulate(data, found.law, found.delay_s, found.saturation_rpm)
    law = np.interp(data.sample_tick, np.arange(len(ticks)), ticks)
    wheel = replay_bench(
        model,
        log.held_since(model.wheel.command_period_s),
        log.command.wheels_rpm[:, 0],
        sample_times_s=samples,
        initial_rpm=data.initial_rpm,
        battery_v=log.channels.get("battery_v"),
    )
    return BenchReplay(
        name=data.name,
        measured_rms_rpm=rms(data.speed_rpm - wheel),
        law_measured_rms_rpm=rms(data.speed_rpm - law),
        servo_rms_rpm=rms(wheel - law),
        servo_max_rpm=float(np.max(np.abs(wheel - law))),
    )


@dataclass(frozen=True)
class RunView:
    """One wheel in one run: commanded, measured and simulated speed."""

    name: str
    split: Split
    rms_rpm: float
    time_s: FloatArray
    """Times of the samples [s], shape (N,)."""
    measured_rpm: FloatArray
    residual_rpm: FloatArray
    """Measured minus simulated, shape (N,)."""
    tick_s: FloatArray
    """Times of the law's ticks [s], shape (K+1,)."""
    simulated_rpm: FloatArray
    """At the ticks, shape (K+1,)."""
    command_rpm: FloatArray
    """Command after delay and ceiling, held from each tick, shape (K+1,)."""


def run_views(fit: Fit, most: int = 6) -> list[RunView]:
    """Return up to `most` runs to show: the worst of each split, the held-out ones first."""
    views: list[RunView] = []
    shares = _shares([len(fit.pooled(split)) for split in HELD_OUT_FIRST], most)
    for split, share in zip(HELD_OUT_FIRST, shares, strict=True):
        views += sorted(_views(fit, split), key=lambda view: -view.rms_rpm)[:share]
    return views


def _views(fit: Fit, split: Split) -> list[RunView]:
    found = fit.estimate
    views = []
    for run in fit.pooled(split):
        tau = run.sample_period_s
        simulated = simulate(run, found.law, found.delay_s, found.saturation_rpm)
        command = run.command(found.delay_s, found.saturation_rpm)
        error = residual(run, found)
        views.append(
            RunView(
                name=run.name,
                split=split,
                rms_rpm=rms(error),
                time_s=np.asarray(run.sample_tick * tau),
                measured_rpm=run.speed_rpm,
                residual_rpm=error,
                tick_s=np.asarray(np.arange(len(simulated)) * tau, float),
                simulated_rpm=simulated,
                command_rpm=np.append(command, command[-1]),
            )
        )
    return views


def _shares(available: list[int], most: int) -> list[int]:
    """Distribute `most` places over groups in turn, to none more than are available."""
    shares = [0] * len(available)
    while sum(shares) < min(most, sum(available)):
        for i, count in enumerate(available):
            if shares[i] < count and sum(shares) < most:
                shares[i] += 1
    return shares


def _lines(title: str) -> str:
    """Return a title in lines that are no wider than one of the six plots."""
    return "\n".join(textwrap.wrap(title, _TITLE_LETTERS))


def write_fit_plots(fit: Fit, folder: Path, model: Model | None = None) -> Path:
    """Write `fit.png` into a folder and return its path.

    With the `model` of the fit its speeds are drawn, too, where law and effects were fitted together.
    """
    together = {} if model is None else speeds_with_effects(fit, model)
    views = run_views(fit, most=4)
    figure = Figure(figsize=(13.5, 7.2), layout="constrained")
    axes = figure.subplots(2, 3)
    for ax, view in zip(axes.flat[:4], views, strict=False):
        _overlay(ax, view, together.get(view.name))
    for ax in axes.flat[len(views) : 4]:
        ax.set_axis_off()
    _residuals(axes.flat[4], fit, views)
    _poles(axes.flat[5], fit)
    title = f"{fit.dataset.name}: measured against the identified law ({fit.estimate.method})"
    figure.suptitle("\n".join(textwrap.wrap(title, 2 * _TITLE_LETTERS)))
    path = folder / "fit.png"
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=110)
    return path


def _overlay(ax: Axes, view: RunView, together: tuple[FloatArray, FloatArray] | None) -> None:
    ax.plot(view.time_s, view.measured_rpm, ".", ms=3, color=_COLOURS["measured"], label="measured")
    ax.step(view.tick_s, view.command_rpm, where="post", lw=1, color=_COLOURS["command"], label="command")
    law = "simulated" if together is None else "law alone"
    ax.plot(view.tick_s, view.simulated_rpm, lw=1.5, color=_COLOURS["simulated"], label=law)
    if together is not None:
        ax.plot(*together, lw=1.2, color=_COLOURS["with effects"], label="with effects")
    ax.set(xlabel="time [s]", ylabel="rpm")
    ax.set_title(_lines(f"{view.name} ({view.split}), rms {view.rms_rpm:.2f} rpm"), fontsize=9)
    ax.legend(fontsize=8)


def _residuals(ax: Axes, fit: Fit, views: list[RunView]) -> None:
    for view in views:
        ax.plot(view.time_s, view.residual_rpm, lw=0.7, label=f"{view.name} ({view.split})")
    sigma = float(np.mean(list(fit.sigma_rpm.values())))
    ax.axhspan(-2 * sigma, 2 * sigma, color="0.9", zorder=0, label="noise, 2 sigma")
    ax.set_title("measured minus simulated", fontsize=9)
    ax.set(xlabel="time [s]", ylabel="rpm")
    ax.legend(fontsize=7)


def _poles(ax: Axes, fit: Fit) -> None:
    turn = np.linspace(0, 2 * np.pi, 200)
    ax.plot(np.cos(turn), np.sin(turn), color="0.6", lw=1)
    poles = fit.law.poles
    ax.plot(poles.real, poles.imag, "x", ms=9, mew=2, color=_COLOURS["simulated"])
    ax.set_title("poles in the unit circle: " + ", ".join(f"{abs(p):.3f}" for p in poles), fontsize=9)
    ax.set(aspect="equal", xlim=(-1.15, 1.15), ylim=(-1.15, 1.15))
