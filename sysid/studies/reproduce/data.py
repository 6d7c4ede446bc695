"""The data sets of the paper's experiments, recorded from the target system."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mecanum_env.units import FloatArray
from sysid.fit.estimators import WheelRun
from sysid.studies.reproduce import published
from sysid.studies.target_system import TargetRecord, TargetSystem, simulate_target

NOISE_RPM = 0.5
"""Standard deviation of the white noise on the logged speed, in addition to the encoder's counts [rpm]."""
LAW_PERIOD_S = 1.0 / 120.0
"""Period of the identified laws: 12 ticks per command, as for the paper's coefficients."""
_LOG_PERIOD_S = 0.01
REST_PERIODS = 1
"""Command periods at rest before each step."""
STEP_PERIODS = 10
"""Command periods of a step: 1 s, four times the settling time."""

_SHORT_PERIODS = (1, 2)  # of 0.1 s: less than the settling time of 0.25 s
_LONGEST_HOLD = 12


@dataclass(frozen=True, eq=False)
class Recording:
    """One run of the target system."""

    name: str
    """Name of its set, such as "step 40 rpm" or "trial 2"; repeats share it."""
    record: TargetRecord
    run: WheelRun
    """The same run as the estimators take it, with unlimited commands."""


@dataclass(frozen=True, eq=False)
class DataSets:
    """All recordings of the experiment."""

    fit: tuple[Recording, ...]
    test: tuple[Recording, ...]
    beyond: tuple[Recording, ...]
    """One step beyond the ceiling."""
    trials: tuple[Recording, ...]
    """Trials with random commands."""
    search: tuple[Recording, ...]
    """Steps of 60 rpm, which Nakagawa et al. fitted, for the exhaustive search alone."""

    @property
    def fit_runs(self) -> list[WheelRun]:
        """The runs that every method except the exhaustive search is fitted to."""
        return [recording.run for recording in self.fit]

    def runs_for(self, method: str) -> list[WheelRun]:
        """Return the runs that a `method` is fitted to."""
        return [recording.run for recording in self.search] if method == "exhaustive" else self.fit_runs


@lru_cache(maxsize=2)
def record_data_sets(seed: int) -> DataSets:
    """Record all data sets; the seed is that of noise, encoder phases and random commands.

    Those of the latest seeds are kept, since every method asks for them.
    """
    rng = np.random.default_rng(seed)

    def steps(speeds_rpm: Sequence[int], repeats: int) -> tuple[Recording, ...]:
        return tuple(
            record(f"step {speed} rpm", step_command(speed), rng)
            for speed in speeds_rpm
            for _ in range(repeats)
        )

    return DataSets(
        fit=steps(published.FIT_STEPS_RPM, published.FIT_REPEATS),
        test=steps(published.TEST_STEPS_RPM, published.TEST_REPEATS),
        beyond=steps([published.BEYOND_RPM], 1),
        trials=tuple(
            record(f"trial {i + 1}", random_hold_command(rng), rng) for i in range(published.TRIALS)
        ),
        search=steps([published.SEARCH_RPM], published.FIT_REPEATS),
    )


def step_command(speed_rpm: float) -> FloatArray:
    """Return one command per 0.1 s: rest, then the speed, shape (REST_PERIODS + STEP_PERIODS,)."""
    return np.concatenate([np.zeros(REST_PERIODS), np.full(STEP_PERIODS, float(speed_rpm))])


def random_hold_command(rng: np.random.Generator) -> FloatArray:
    """Return a random trial, one command per 0.1 s, shape (52,).

    Five holds of 0.3 s or more (the drive settles in 0.25 s) and five of 0.1 or 0.2 s in random order, at
    whole speeds from 0 to 130 rpm, forward as in the paper.
    """
    total = round(published.TRIAL_S / 0.1)
    while True:
        short = rng.choice(_SHORT_PERIODS, 5)
        long = rng.integers(3, _LONGEST_HOLD + 1, 5)
        if short.sum() + long.sum() == total:
            break
    periods = np.concatenate([short, long])
    rng.shuffle(periods)
    return np.repeat(rng.integers(0, 131, 10).astype(float), periods)


def record(name: str, command_rpm: FloatArray, rng: np.random.Generator) -> Recording:
    """Run the target system through one command per 0.1 s, shape (m,), and put the log on the law's clock."""
    system = TargetSystem()
    log = simulate_target(command_rpm, rng=rng, noise_rpm=NOISE_RPM, sample_period_s=_LOG_PERIOD_S)
    # Rounding to counts is uniform, and a speed is the difference of two counts.
    count_rpm = 60.0 / (system.encoder_counts * system.gear_ratio * _LOG_PERIOD_S)
    sigma = float(np.hypot(NOISE_RPM, count_rpm / np.sqrt(6.0)))
    commands = np.repeat(command_rpm, round(system.command_period_s / LAW_PERIOD_S))
    run = WheelRun(
        command_rpm=commands,
        sample_tick=np.minimum(log.time_s / LAW_PERIOD_S, float(len(commands))),
        speed_rpm=log.speed_rpm,
        sigma_rpm=np.full(len(log.time_s), sigma),
        initial_rpm=0.0,
        sample_period_s=LAW_PERIOD_S,
        name=name,
    )
    return Recording(name, log, run)
