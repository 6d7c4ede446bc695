"""What happens to a logged command before it reaches the wheel law: clock, rounding and ceiling.

A log contains when commands appeared, but not how the platform processes them. The defaults are the robot's:
a command latched every 0.1 s, whole rpm, a ceiling of 135 rpm. Where a log contradicts a default, the value
that the log shows is used, with a note.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.errors import InputError
from mecanum_env.model import Wheel
from mecanum_env.units import FloatArray
from sysid.fit.drive.command_clock import command_clock_s
from sysid.logs import BodyCommand, Dataset, Run

COMMAND_PERIOD_S: Final = Wheel.command_period_s
_COMMAND_QUANTUM_RPM: Final = Wheel.command_quantum_rpm
_SATURATION_RPM: Final = Wheel.saturation_rpm
LAW_RATE_HZ: Final = 120.0
"""Default rate of the law: the published rise and settling times fit a period of 1/120 s."""
_SLOW_TICK: Final = 1.2
"""Length of the law's tick, relative to the default, above which there is one more to a command."""
_CEILING_MARGIN: Final = 1.05
_FEW_CHANGES: Final = 5  # fewer changes of command do not show a period
UNSEEN_TICKS: Final = 2.0  # ticks per sample above which the law could oscillate unseen between samples
_BRIEF: Final = 0.95  # quantile of speed: an overshoot lasts less than the remaining share of a run


@dataclass(frozen=True)
class CommandPath:
    """How the commands of a dataset reach the law."""

    sample_period_s: float
    """Period of the law [s]; the command period is a multiple of it."""
    command_period_s: float
    """Shortest time between commands that the platform accepts [s]."""
    quantum_rpm: float
    """Rounding of commands [rpm]; 0: none."""
    saturation_rpm: float
    """Ceiling of a wheel command [rpm]; infinite if the log shows none."""
    seek_ceiling: bool
    """Whether commands exceed the ceiling or the speeds reached, so that a ceiling can be estimated."""
    latched: bool
    """Whether commands take effect on a clock of the command period that starts with the run, rather than at
    the times of the log."""
    notes: tuple[str, ...]
    """Defaults that the log contradicts, in sentences."""
    exact: bool = False
    """Whether commands are known to act at these times, so that no other clock is tried."""


def infer_command_path(
    dataset: Dataset,
    *,
    sample_period_s: float | None = None,
    command_period_s: float | None = None,
    quantum_rpm: float | None = None,
    saturation_rpm: float | None = None,
) -> CommandPath:
    """Return the command path with the given values, and the others from a dataset.

    The default period of the law is the whole fraction of the command period nearest 1/120 s, or nearest the
    log's own interval where samples are more than two such ticks apart. The defaults of the others are 0.1 s,
    1 rpm and 135 rpm, unless commands change faster, are not whole, or speeds exceed the ceiling.

    Raises:
        InputError: a value that is not positive, or a law slower than the commands.
    """
    notes: list[str] = []
    for name, value in (("sample_period_s", sample_period_s), ("command_period_s", command_period_s)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise InputError(f"{name} = {value:g}, must be above 0 and finite")
    period, latched = command_period_s, True
    if period is None:
        period, latched = _command_clock(dataset, sample_period_s, notes)
    if sample_period_s is None:
        rate_hz = _law_rate_hz(dataset, notes)
        ticks = max(1, round(period * rate_hz))
        # A tick that is much longer than the rows would not show what they do.
        sample_period_s = period / (ticks + (period * rate_hz > _SLOW_TICK * ticks))
    if sample_period_s > period * (1 + 1e-9):
        raise InputError(
            f"sample_period_s = {sample_period_s:g} is longer than command_period_s = {period:g}: "
            "the law would miss commands; choose a shorter one"
        )
    if quantum_rpm is None:
        quantum_rpm = _COMMAND_QUANTUM_RPM
        if not all(_is_whole(run, quantum_rpm) for run in dataset.runs):
            quantum_rpm = 0.0
            notes.append("commands are not whole rpm: command_quantum_rpm is 0 (no rounding)")
    seek = False
    if saturation_rpm is None:
        saturation_rpm = _SATURATION_RPM
        reached = max(_reached_rpm(run) for run in dataset.runs)
        asked = max(float(np.max(np.abs(run.command.wheels_rpm))) for run in dataset.runs)
        seek = asked > _SATURATION_RPM or asked > _CEILING_MARGIN * reached > 0.0
        if reached > _SATURATION_RPM:
            saturation_rpm = math.inf
            notes.append(
                f"speeds stay at up to {reached:.0f} rpm, beyond the robot's ceiling of {_SATURATION_RPM:g} "
                "rpm: the ceiling is not assumed"
            )
    return CommandPath(sample_period_s, period, quantum_rpm, saturation_rpm, seek, latched, tuple(notes))


def _command_clock(dataset: Dataset, sample_period_s: float | None, notes: list[str]) -> tuple[float, bool]:
    """Return the command period [s] and whether commands are latched on its clock; add notes.

    Each run is examined by itself, so that slow commands in one do not hide fast ones in another.
    """
    changes = [run.command_changes()[0] for run in dataset.runs]
    # Times are as fine as the log's rows: commands 0.1 s apart may appear closer by one row.
    rows = [run.median_interval_s for run in dataset.runs]
    fast = [
        float(np.quantile(np.diff(t), 0.05))
        for t, row in zip(changes, rows, strict=True)
        if len(t) > _FEW_CHANGES and np.quantile(np.diff(t), 0.05) < 0.75 * (COMMAND_PERIOD_S - row)
    ]
    # A change appears in the first row after it, however late that is.
    held = [run.held_since(COMMAND_PERIOD_S)[run.command_rows()] for run in dataset.runs]
    if not fast and all(
        _on_clock(t, COMMAND_PERIOD_S, min(0.2 * COMMAND_PERIOD_S, 1e-6 + 0.51 * row))
        for t, row in zip(held, rows, strict=True)
    ):
        return COMMAND_PERIOD_S, True
    clock = command_clock_s(dataset.runs) if sample_period_s is None else None
    if clock is not None:
        notes.append(
            f"commands change on a clock of {clock * 1e3:.4g} ms that starts with the run: command_period_s "
            "is taken from the log"
        )
        return clock, True
    if fast and all(
        _on_clock(t, min(fast), max(0.1 * min(fast), 1.01 * row))
        for t, row in zip(changes, rows, strict=True)
    ):
        notes.append(
            f"commands change every {min(fast) * 1e3:.3g} ms, faster than {COMMAND_PERIOD_S:g} s: "
            "command_period_s is taken from the log"
        )
        return min(fast), False
    said = f"commands do not change on a {COMMAND_PERIOD_S:g} s clock that starts with the run"
    row = float(np.median(rows))
    # Stamps are rounded: over many rows a clock of the median interval would run ahead of them, or behind.
    whole = [max(1, round(run.duration_s / one)) for run, one in zip(dataset.runs, rows, strict=True)]
    mean = float(np.median([run.duration_s / count for run, count in zip(dataset.runs, whole, strict=True)]))
    row = row if math.isclose(row, mean) else mean
    if 1.0 / LAW_RATE_HZ < row < COMMAND_PERIOD_S and all(_on_clock(t, row, 0.02 * row) for t in changes):
        notes.append(f"{said}, but on the log's own of {row:g} s, which is taken as command_period_s")
        return row, True
    period = sample_period_s or 1.0 / LAW_RATE_HZ
    notes.append(
        f"{said}: the log's own stamps are taken as the moments at which they took effect, and the model "
        f"takes commands at every tick of the law (command_period_s = {period:.4g})"
    )
    return period, False


def _on_clock(times_s: FloatArray, period_s: float, tolerance_s: float) -> bool:
    """Return whether all times [s] are multiples of a period [s] within a tolerance [s]."""
    phase = times_s / period_s
    return bool(np.all(np.abs(phase - np.rint(phase)) * period_s <= tolerance_s))


def _law_rate_hz(dataset: Dataset, notes: list[str]) -> float:
    """Return the default rate of the law [Hz], no faster than the log can show.

    A faster law could alternate from tick to tick between samples, and a fit would use that freedom.
    """
    interval = min(run.median_interval_s for run in dataset.runs)
    if interval * LAW_RATE_HZ <= UNSEEN_TICKS * (1.0 + 1e-6):
        return LAW_RATE_HZ
    notes.append(
        f"samples come every {interval * 1e3:.3g} ms, and so does the law's tick: a faster one is not seen"
    )
    return 1.0 / interval


def _is_whole(run: Run, quantum_rpm: float) -> bool:
    c = run.command
    values = np.stack([c.v_rpm, c.vc_rpm]) if isinstance(c, BodyCommand) else c.wheels_rpm
    return bool(np.allclose(values, np.rint(values / quantum_rpm) * quantum_rpm, rtol=0.0, atol=1e-6))


def _reached_rpm(run: Run) -> float:
    """Return the largest speed [rpm] that a wheel of the run holds for longer than an overshoot lasts."""
    speeds = [np.abs(x[np.isfinite(x)]) for name, x in run.channels.items() if name.startswith("speed_")]
    return max((float(np.quantile(speed, _BRIEF)) for speed in speeds if speed.size), default=0.0)
