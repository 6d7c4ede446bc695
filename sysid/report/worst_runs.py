"""Which runs a report shows, and what is drawn of each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mecanum_env.units import FloatArray
from sysid.fit.drive_choice import pooled
from sysid.fit.figures import residual, rms, simulate
from sysid.fit.pipeline import Fit
from sysid.logs import Split


@dataclass(frozen=True)
class RunView:
    """One wheel in one run: what was asked, measured and simulated."""

    name: str
    split: Split
    rms_rpm: float
    time_s: FloatArray
    """Of the samples, shape (N,)."""
    measured_rpm: FloatArray
    residual_rpm: FloatArray
    """Measured minus simulated, shape (N,)."""
    tick_s: FloatArray
    """Of the law's ticks, shape (K+1,)."""
    simulated_rpm: FloatArray
    """Shape (K+1,)."""
    command_rpm: FloatArray
    """Command that the law saw, held from each tick, shape (K+1,)."""


def run_views(fit: Fit, most: int = 6) -> list[RunView]:
    """Return up to `most` runs to show: the worst of each held-out split first, then of the fit runs."""
    views: list[RunView] = []
    order: tuple[Split, ...] = ("test", "validation", "fit")
    shares = _shares([len(pooled(fit.runs[split])) for split in order], most)
    for split, share in zip(order, shares, strict=True):
        views += sorted(_views(fit, split), key=lambda view: -view.rms_rpm)[:share]
    return views


def _views(fit: Fit, split: Split) -> list[RunView]:
    found = fit.estimate
    views = []
    for run in pooled(fit.runs[split]):
        tau = run.sample_period_s
        simulated = simulate(run, found.law, found.delay_s, found.saturation_rpm)
        command = run.command(found.delay_s, found.saturation_rpm)
        error = residual(run, found)
        views.append(
            RunView(
                run.name,
                split,
                rms(error),
                np.asarray(run.sample_tick * tau),
                run.speed_rpm,
                error,
                np.asarray(np.arange(len(simulated)) * tau, float),
                simulated,
                np.append(command, command[-1]),
            )
        )
    return views


def _shares(available: list[int], most: int) -> list[int]:
    """Split `most` places among groups in turn, none getting more than it has."""
    shares = [0] * len(available)
    while sum(shares) < min(most, sum(available)):
        for i, count in enumerate(available):
            if shares[i] < count and sum(shares) < most:
                shares[i] += 1
    return shares
