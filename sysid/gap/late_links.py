"""A study of logs through a link that delays every change of the command differently.

The delay of each change is a nuisance: it is estimated, the changes are moved to where they acted, and the
study compares what is left. The common delay of the logs is kept, so that another one than the model's is
found as an effect.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace

from mecanum_env.model import Model
from mecanum_env.model.file import model_to_dict
from sysid.compare.late_links import (
    JITTER,
    LOSS,
    aligned,
    delay_of,
    on_aligned,
    resolution_s,
    with_jitter,
    without_delays,
)
from sysid.compare.link_delays import LinkDelays, link_delays
from sysid.gap.result import GapReport
from sysid.logs import Dataset


@dataclass(frozen=True, eq=False)
class LateLogs:
    """Logs with their changes of command moved to where they acted, and the model for them."""

    delays: LinkDelays
    dataset: Dataset
    model: Model
    given: Model
    """The model as it was given, whose delay jitters."""

    def alike(self, other: Dataset) -> Dataset:
        """Return `other` logs through the same link, such as those of the fit, in the same way."""
        if other.level != "bench":
            return other
        return aligned(other, _delays(other, self.given), self.model.wheel.command_period_s)

    def described(self, report: GapReport) -> GapReport:
        """Return the report on these logs as that on the logs and the model as they were given."""
        found = self.delays
        lost = f"; {found.loss:.0%} of the changes never act" if found.lost.any() else ""
        note = (
            "every change of the command acts at a time of its own, as the model says: "
            f"{found.mean_s * 1e3:.0f} ms late with a spread of {found.spread_s * 1e3:.0f} ms in these logs"
            f"{lost} ({self._stated()}); compared is what is left with the delay of each change as found"
        )
        improved = self._as_given(report.model)
        sha = hashlib.sha256(json.dumps(model_to_dict(self.given), sort_keys=True).encode()).hexdigest()
        return replace(
            report,
            model=improved,
            base=self.given,
            notes=(note, *report.notes),
            provenance={**report.provenance, "model_sha256": sha},
        )

    def _stated(self) -> str:
        """Return what the model says of its link."""
        effects = self.given.effects
        delay = f"{delay_of(self.given) * 1e3:.0f}"
        jitter = f" and {effects[JITTER]['jitter_s'] * 1e3:.0f}" if JITTER in effects else ""
        lost = f", {effects[LOSS]['share']:.1%} of the commands lost" if LOSS in effects else ""
        return f"model: {delay}{jitter} ms{lost}"

    def _as_given(self, model: Model) -> Model:
        """Return a model of the moved changes with the link of the given one."""
        period, effects = self.given.wheel.command_period_s, self.given.effects
        if JITTER in effects:
            model = with_jitter(model, effects[JITTER]["jitter_s"], period)
        if LOSS in effects:
            model = replace(model, effects={LOSS: effects[LOSS], **model.effects})
        return replace(model, wheel=replace(model.wheel, command_period_s=period))


def late_logs(dataset: Dataset, model: Model) -> LateLogs | None:
    """Return bench logs without the different delays of their changes; None if the model's link has none."""
    if dataset.level != "bench" or not {JITTER, LOSS} & set(model.effects):
        return None
    found, delay, tick = _delays(dataset, model), delay_of(model), model.wheel.law.sample_period_s
    # The changes are moved by their delays beyond the logs' own mean: another mean is for the study to find.
    period = resolution_s(tick, max(delay, found.mean_s))
    return LateLogs(found, aligned(dataset, found, period), on_aligned(model, delay, period), model)


def _delays(dataset: Dataset, model: Model) -> LinkDelays:
    tick = model.wheel.law.sample_period_s
    clock = model.wheel.command_period_s if model.wheel.command_period_s > tick else None
    return link_delays(without_delays(model), dataset.runs, clock, resolution_s(tick, delay_of(model)))
