"""Synthetic bench logs with known truth: a law's steps seen through noise and rounding."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mecanum_env.law import LawState, WheelLaw
from sysid.estimators import WheelRun

STEPS_RPM = (10.0, 40.0, 80.0, 130.0)


def step_runs(
    law: WheelLaw,
    rng: np.random.Generator,
    *,
    noise_rpm: float = 0.5,
    quantum_rpm: float = 1.0,
    repeats: int = 3,
    seconds: float = 2.0,
    steps_rpm: Sequence[float] = STEPS_RPM,
) -> list[WheelRun]:
    """Return one run per step and repeat: rest for 0.1 s, then the step, sampled at every tick.

    The sigma handed to the estimators is the true one, the rounding's quantum/sqrt(12) included.
    """
    ticks = round(seconds / law.sample_period_s)
    rest = round(0.1 / law.sample_period_s)
    sigma = max(np.hypot(noise_rpm, quantum_rpm / np.sqrt(12.0)), 1e-9)
    runs = []
    for step in steps_rpm:
        command = np.where(np.arange(ticks) < rest, 0.0, step)
        true = law.simulate(command, LawState.steady(0.0))
        for repeat in range(repeats):
            speed = true + noise_rpm * rng.standard_normal(ticks + 1)
            if quantum_rpm > 0.0:
                speed = np.rint(speed / quantum_rpm) * quantum_rpm
            runs.append(
                WheelRun(
                    command_rpm=command,
                    sample_tick=np.arange(ticks + 1.0),
                    speed_rpm=speed,
                    sigma_rpm=np.full(ticks + 1, sigma),
                    initial_rpm=0.0,
                    sample_period_s=law.sample_period_s,
                    name=f"step_{step:03.0f}_{repeat + 1}",
                )
            )
    return runs
