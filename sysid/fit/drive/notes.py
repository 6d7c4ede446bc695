"""What a user should know about a fitted law: its delay, its ceiling, and a gain that the logs contradict."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from mecanum_env.statistics import rms
from sysid.fit.drive.choice import held_out_residual, representative
from sysid.fit.drive.command_path import CommandPath
from sysid.fit.drive.fitter import LawFitter, longest_tried_s
from sysid.fit.drive.wheel_data import longest_hold_s, pooled
from sysid.fit.estimators import Estimate
from sysid.fit.statistics import Runs
from sysid.logs import Dataset

_WORTH_SAYING: Final = 0.02
"""Least difference of a free gain from 1, and relative decrease of the validation error by it, for a note."""


def drive_notes(dataset: Dataset, path: CommandPath, found: Estimate, sought_delay: bool) -> list[str]:
    """Return notes on the delay, if it was sought (`sought_delay`), and the ceiling that were `found`."""
    notes = []
    if sought_delay and found.delay_s > 0.0:
        exactly = "" if "delay_s" in found.free else " (in whole ticks)"
        notes.append(
            f"a transport delay of {found.delay_s * 1e3:.1f} ms was estimated{exactly} and is in the model "
            "as command_latency; wheel speeds alone cannot tell it from sensor_latency"
        )
        longest = longest_tried_s(path)
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


def gain_notes(runs: Runs, fitter: LawFitter, found: Estimate) -> list[str]:
    """Return notes on logs that contradict the unit DC gain that the law is given.

    A law of unit gain can imitate another gain by a pole so slow that it does not settle while any command is
    held; rise and settling times are meaningless then. The `runs` are those that the law was `found` with.
    """
    notes = []
    slowest = abs(found.law.poles[0])
    constant_s = -found.law.sample_period_s / math.log(slowest) if 0.0 < slowest < 1.0 else 0.0
    held_s = longest_hold_s(runs)
    if constant_s > held_s:
        notes.append(
            f"the slowest pole has a time constant of {constant_s:.3g} s, but no command is held longer than "
            f"{held_s:.3g} s: rise and settling times are extrapolated"
        )
    if not fitter.unit_gain:
        return notes
    # An estimated ceiling may only imitate a gain below 1.
    others = [
        fitter.run(
            representative(pooled(runs["fit"])),
            delay_s=found.delay_s,
            saturation_rpm=limit,
            initial=[found.coefficients.tolist()],
            unit_gain=False,
        )
        for limit in {found.saturation_rpm, math.inf}
    ]
    before = rms(held_out_residual(runs, found))
    after, free = min(((rms(held_out_residual(runs, o)), o) for o in others), key=lambda pair: pair[0])
    if abs(free.law.dc_gain - 1.0) > _WORTH_SAYING and after < (1.0 - _WORTH_SAYING) * before:
        notes.append(
            f"unit DC gain is assumed, but a gain of {free.law.dc_gain:.3g} lowers the held-out error from "
            f"{before:.3g} to {after:.3g} rpm: try --free-gain, or check the units of command and speed"
        )
    return notes
