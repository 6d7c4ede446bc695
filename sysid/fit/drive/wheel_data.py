"""From logs to the data of the estimators: a `WheelRun` for each wheel in each run, on the law's clock."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Final

import numpy as np

from mecanum_env.errors import InputError
from mecanum_env.kinematics import WHEEL_SPEEDS, WHEELS, command_to_wheels, round_command
from mecanum_env.law import WheelLaw
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.drive import RING, DriveParameters
from mecanum_env.wheel_drive.inputs import LatchedLog
from sysid.fit.drive.command_path import CommandPath
from sysid.fit.estimators import WheelRun
from sysid.fit.statistics import Runs
from sysid.logs import BenchCommand, BodyCommand, Dataset, Run
from sysid.logs.first_samples import speed_at_start
from sysid.logs.runs import SPLITS

_START_TICKS: Final = 1.0  # samples up to this tick show no response yet: the law responds one tick later


def wheel_columns(run: Run) -> dict[str, str]:
    """Return wheel name -> measured speed column; the bench's one wheel is called "wheel".

    Raises:
        InputError: the run has no wheel speed.
    """
    if isinstance(run.command, BenchCommand):
        return {"wheel": "speed_rpm"}
    found = {w: column for w, column in zip(WHEELS, WHEEL_SPEEDS, strict=True) if column in run.channels}
    if not found:
        raise InputError(
            f"{run.file}: no wheel speed (speed_fl_rpm ...); the wheel law is fitted to wheel speeds, "
            f"this run has {', '.join(run.channels)}"
        )
    return found


def _wheel_commands(run: Run, path: CommandPath) -> dict[str, FloatArray]:
    """Return wheel name -> commanded speed [rpm] at the run's rows, shape (n,), rounded but not limited."""
    command = run.command
    if isinstance(command, BodyCommand):
        rounded = round_command(command.v_rpm, command.theta_deg, command.vc_rpm, path.quantum_rpm)
        return dict(zip(WHEELS, command_to_wheels(*rounded).T, strict=True))
    wheels = command.wheels_rpm
    if path.quantum_rpm > 0.0:
        wheels = np.rint(wheels / path.quantum_rpm) * path.quantum_rpm
    return dict(zip(("wheel",) if isinstance(command, BenchCommand) else WHEELS, wheels.T, strict=True))


def wheel_run(run: Run, wheel: str, path: CommandPath, sigma_rpm: float) -> WheelRun | None:
    """Return a run's `wheel` (see `wheel_columns`), with noise of `sigma_rpm` [rpm], on the law's clock.

    None if it has no sample.
    """
    column = wheel_columns(run)[wheel]
    speed = run.channels[column]
    finite = np.isfinite(speed)
    if not finite.any():
        return None
    tau = path.sample_period_s
    ticks = run.time_s[finite] / tau
    n_ticks = max(1, math.ceil(float(ticks[-1]) - 1e-6))
    command = _wheel_commands(run, path)[wheel]
    drive = _drive(path)
    since = run.held_since(drive.command_period_s)
    initial = speed_at_start(speed[finite][ticks <= _START_TICKS], sigma_rpm)

    @lru_cache(maxsize=2)
    def latched(ceiling_rpm: float) -> LatchedLog:
        return LatchedLog.of(replace(drive, saturation_rpm=ceiling_rpm), since, command, n_ticks, initial)

    def source(delay_s: float, saturation_rpm: float) -> FloatArray:
        ceiling = min(saturation_rpm, path.saturation_rpm)
        # Nothing in this drive changes with time, so that a delay does not change what is latched.
        return latched(ceiling).inputs(replace(drive, delay_s=delay_s, saturation_rpm=ceiling))

    return WheelRun(
        command_rpm=source(0.0, math.inf),
        sample_tick=np.minimum(ticks, float(n_ticks)),
        speed_rpm=speed[finite],
        sigma_rpm=sigma_rpm / np.sqrt(run.weights.get(column, np.ones(finite.size))[finite]),
        initial_rpm=initial,
        sample_period_s=tau,
        name=run.file if wheel == "wheel" else f"{run.file} {wheel}",
        source=source,
    )


def driven(run: WheelRun, delay_s: float = 0.0, saturation_rpm: float = math.inf) -> WheelRun:
    """Return the run with its commands delayed by `delay_s` [s] and limited to `saturation_rpm` [rpm]."""
    if delay_s == 0.0 and saturation_rpm == math.inf:
        return run

    def source(further_s: float, limit_rpm: float) -> FloatArray:
        return run.command(delay_s + further_s, min(limit_rpm, saturation_rpm))

    return replace(run, command_rpm=run.command(delay_s, saturation_rpm), source=source)


def wheel_runs(
    runs: tuple[Run, ...], path: CommandPath, sigma_rpm: Mapping[str, float]
) -> dict[str, list[WheelRun]]:
    """Return wheel name -> its runs; `sigma_rpm` gives each measured column's noise [rpm]."""
    result: dict[str, list[WheelRun]] = {}
    for run in runs:
        for wheel, column in wheel_columns(run).items():
            data = wheel_run(run, wheel, path, sigma_rpm[column])
            if data is not None:
                result.setdefault(wheel, []).append(data)
    return result


def longest_delay_s(path: CommandPath) -> float:
    """Return the longest transport delay [s] that the wheel plugin can hold for a command path."""
    # One command period less than the ring holds, as the plugin's bound is a physics step shorter.
    return (RING - 4) * _drive(path).command_period_s


def _drive(path: CommandPath) -> DriveParameters:
    """Return the parameters of the command path; the law's coefficients are not used."""
    period = path.command_period_s if path.latched else path.sample_period_s
    pass_through = WheelLaw(0.0, 0.0, 0.0, 1.0, 0.0, 0.0, path.sample_period_s)
    # The quantum is 0, because commands are rounded before the kinematics, as on the robot.
    return DriveParameters(pass_through, period, 0.0, path.saturation_rpm)


def pooled(wheels: Mapping[str, Sequence[WheelRun]]) -> list[WheelRun]:
    """Return the runs of all wheels in one list."""
    return [run for runs in wheels.values() for run in runs]


def runs_by_split(dataset: Dataset, path: CommandPath, sigma_rpm: Mapping[str, float]) -> Runs:
    """Return split -> wheel -> runs on the law's clock, with the noise `sigma_rpm` of each column."""
    return {split: wheel_runs(dataset.split(split), path, sigma_rpm) for split in SPLITS}


def longest_hold_s(runs: Runs) -> float:
    """Return the longest time [s] for which a command of the fit runs is held."""
    longest = 0
    for run in pooled(runs["fit"]):
        changes = np.flatnonzero(np.diff(run.command_rpm)) + 1
        longest = max(longest, int(np.max(np.diff(np.concatenate([[0], changes, [len(run.command_rpm)]])))))
    return longest * pooled(runs["fit"])[0].sample_period_s
