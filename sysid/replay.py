"""Replaying logs in MuJoCo with an identified model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mecanum_env.model import Model
from mecanum_env.simulator.bench import replay_bench
from sysid.fit.drive_choice import pooled
from sysid.fit.figures import residual, rms, simulate
from sysid.fit.pipeline import Fit
from sysid.logs import Split


@dataclass(frozen=True)
class BenchReplay:
    """One bench run replayed on MuJoCo's free wheel, beside the law alone."""

    name: str
    measured_rms_rpm: float
    """Measured minus MuJoCo."""
    law_measured_rms_rpm: float
    """Measured minus the law."""
    servo_rms_rpm: float
    """MuJoCo minus the law: what the servo between law and wheel adds, next to nothing."""
    servo_max_rpm: float


def replay_worst(fit: Fit, model: Model) -> BenchReplay | None:
    """Replay the held-out bench run that the law predicts worst; None for robot logs.

    Args:
        fit: the fitted wheel, with its runs.
        model: the model made from it.
    """
    if fit.dataset.level != "bench":
        return None
    order: tuple[Split, ...] = ("test", "validation", "fit")
    split = next(split for split in order if pooled(fit.runs[split]))
    data = max(pooled(fit.runs[split]), key=lambda run: rms(residual(run, fit.estimate)))
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
    )
    return BenchReplay(
        name=data.name,
        measured_rms_rpm=rms(data.speed_rpm - wheel),
        law_measured_rms_rpm=rms(data.speed_rpm - law),
        servo_rms_rpm=rms(wheel - law),
        servo_max_rpm=float(np.max(np.abs(wheel - law))),
    )
