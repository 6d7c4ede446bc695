"""What a user should know about a fit, in sentences: what was adopted or assumed, what does not hold."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sysid.fit.command_path import CommandPath
from sysid.fit.drive_choice import LONGEST_DELAY_S, Search, held_out_rms, pooled, representative
from sysid.fit.estimators import Estimate
from sysid.fit.metrics import Runs
from sysid.fit.wheel_data import longest_delay_s
from sysid.logs import Dataset

_WORTH_SAYING: Final = 0.02
"""Distance of a free gain from 1, and relative fall of the validation error by it, from which unit gain is
doubted."""


def drive_notes(dataset: Dataset, path: CommandPath, found: Estimate, sought_delay: bool) -> list[str]:
    """Say what was found before the law: delay, ceiling.

    Args:
        dataset: the logs.
        path: how commands reach the law.
        found: the estimate.
        sought_delay: the delay was estimated, not given.
    """
    notes = []
    if sought_delay and found.delay_s > 0.0:
        exactly = "" if "delay_s" in found.free else " (in whole ticks)"
        notes.append(
            f"a transport delay of {found.delay_s * 1e3:.1f} ms was estimated{exactly} and is in the model "
            "as command_latency; wheel speeds alone cannot tell it from sensor_latency"
        )
        longest = min(LONGEST_DELAY_S, longest_delay_s(path))
        if found.delay_s > 0.99 * longest:
            notes.append(f"that delay is the longest tried, {longest * 1e3:.0f} ms: it may be longer")
    asked = max(float(np.max(np.abs(run.command.wheels_rpm))) for run in dataset.runs)
    if math.isfinite(found.saturation_rpm):
        where = (
            "it may as well act on the body's speed (body_speed_limit)"
            if dataset.level == "robot"
            else "a limit elsewhere in the platform looks the same to one wheel"
        )
        notes.append(
            f"commands reach {asked:.0f} rpm; a ceiling of {found.saturation_rpm:.1f} rpm on the wheel "
            f"command was estimated, as it predicts held-out runs better; {where}"
        )
    elif asked > path.saturation_rpm:
        notes.append(
            f"commands reach {asked:.0f} rpm and are clipped at the assumed {path.saturation_rpm:g} rpm; the "
            "logs ask for no other ceiling (--saturation sets one)"
        )
    return notes


def gain_notes(runs: Runs, search: Search, found: Estimate) -> list[str]:
    """Say where the unit DC gain that the law holds by its structure is not what the logs show.

    A law of unit gain can imitate another gain by a pole so slow that no command lasts long enough to see it
    settle; then rise and settling times mean nothing.

    Args:
        runs: by split.
        search: how to fit.
        found: the estimate.
    """
    notes = []
    period = found.law.sample_period_s
    slowest = abs(found.law.poles[0])
    constant_s = -period / math.log(slowest) if 0.0 < slowest < 1.0 else 0.0
    held_s = _longest_hold_s(runs)
    if constant_s > held_s:
        notes.append(
            f"the slowest pole has a time constant of {constant_s:.3g} s, but no command is held longer than "
            f"{held_s:.3g} s: rise and settling times are extrapolated"
        )
    if not search.unit_gain:
        return notes
    # A ceiling may be there only to stand in for a gain below 1.
    limits = {found.saturation_rpm, math.inf}
    others = [
        search.run(
            representative(pooled(runs["fit"])),
            delay_s=found.delay_s,
            saturation_rpm=limit,
            initial=[found.coefficients.tolist()],
            unit_gain=False,
        )
        for limit in limits
    ]
    free = min(others, key=lambda other: held_out_rms(runs, other))
    before, after = held_out_rms(runs, found), held_out_rms(runs, free)
    another = abs(free.law.dc_gain - 1.0) > _WORTH_SAYING
    if another and after < (1.0 - _WORTH_SAYING) * before:
        notes.append(
            f"unit DC gain is assumed, but a gain of {free.law.dc_gain:.3g} lowers the held-out error from "
            f"{before:.3g} to {after:.3g} rpm: try --free-gain, or check the units of command and speed"
        )
    return notes


def _longest_hold_s(runs: Runs) -> float:
    """Return the longest time [s] for which a command of the fit runs is held."""
    longest = 0
    for run in pooled(runs["fit"]):
        changes = np.flatnonzero(np.diff(run.command_rpm)) + 1
        longest = max(longest, int(np.max(np.diff(np.concatenate([[0], changes, [len(run.command_rpm)]])))))
    return longest * pooled(runs["fit"])[0].sample_period_s
