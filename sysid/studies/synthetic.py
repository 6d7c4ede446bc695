"""Synthetic bench logs with known truth: steps and random commands of a law, through noise and rounding."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mecanum_env.law import LawState, WheelLaw
from mecanum_env.units import FloatArray
from sysid.fit.estimators import WheelRun

_STEPS_RPM = (10.0, 40.0, 80.0, 130.0)
NOISE_RPM = 0.5
_HOLD_TICKS = 12
LIMIT_RPM = 135


def step_runs(
    law: WheelLaw,
    rng: np.random.Generator,
    *,
    noise_rpm: float = 0.5,
    quantum_rpm: float = 1.0,
    repeats: int = 3,
    seconds: float = 2.0,
    steps_rpm: Sequence[float] = _STEPS_RPM,
) -> list[WheelRun]:
    """Return one run per step and repeat: 0.1 s at rest, then the step, sampled at every tick.

    The sigma given to the estimators is the true one, including quantum/sqrt(12) of the rounding.
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


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of one wheel, one per tick; each array has shape (N,)."""

    command_rpm: FloatArray
    true_rpm: FloatArray
    speed_rpm: FloatArray
    """Measured speed: the true speed with noise, rounded."""


def random_samples(
    laws: Sequence[tuple[WheelLaw, int]],
    rng: np.random.Generator,
    *,
    noise_rpm: float = NOISE_RPM,
) -> Samples:
    """Return random whole commands within +-135 rpm and the response of several laws, one after the other.

    Each law has its number of ticks, each command is held for 0.1 s at a tick of 1/120 s; the wheel keeps its
    speed when the law changes. `noise_rpm` is the standard deviation of the measured speed before it is
    rounded to whole rpm.
    """
    n = sum(ticks for _, ticks in laws)
    values = rng.integers(-LIMIT_RPM, LIMIT_RPM + 1, -(-n // _HOLD_TICKS))
    command = np.repeat(values, _HOLD_TICKS)[:n].astype(float)
    true = _simulate(laws, command)
    return Samples(command, true, np.rint(true + noise_rpm * rng.standard_normal(n)))


def _simulate(laws: Sequence[tuple[WheelLaw, int]], command: FloatArray) -> FloatArray:
    parts, state, at = [], LawState(), 0
    for law, ticks in laws:
        span = command[at : at + ticks]
        speeds = law.simulate(span, state)
        parts.append(speeds[:-1])
        # The next law starts from the last speeds and commands, newest first.
        past = np.concatenate([[float(np.asarray(state.w2)), float(np.asarray(state.w1))], speeds])
        sent = np.concatenate([[float(np.asarray(state.r2)), float(np.asarray(state.r1))], span])
        state = LawState(past[-1], past[-2], past[-3], sent[-1], sent[-2])
        at += ticks
    return np.concatenate(parts)


def random_stable_law(rng: np.random.Generator, sample_period_s: float) -> WheelLaw:
    """Return a law of unit gain with one real pole, a pair of real or complex poles, and any zeros."""
    poles = [rng.uniform(-0.2, 0.95)]
    if rng.random() < 0.5:
        poles += list(rng.uniform(-0.5, 0.8, 2))
    else:
        pair = rng.uniform(0.0, 0.85) * np.exp(1j * rng.uniform(0.0, 1.5))
        poles += [pair, np.conj(pair)]
    a, b, c = -np.real(np.poly(poles))[1:]
    shares = rng.uniform(-0.3, 1.0, 3)
    while abs(np.sum(shares)) < 0.3:
        shares = rng.uniform(-0.3, 1.0, 3)
    d, e, f = shares * (1.0 - a - b - c) / np.sum(shares)
    return WheelLaw.from_coefficients([a, b, c, d, e, f], sample_period_s).normalised()


def free_run_error_rpm(law: WheelLaw, samples: Samples) -> float:
    """Return the rms of measured minus free-running speed of `law` over `samples` [rpm], both from rest."""
    return float(np.sqrt(np.mean((samples.speed_rpm - law.simulate(samples.command_rpm)[:-1]) ** 2)))
