"""The study of this project: which effects the simulator lacks, and what adding them gains."""

from __future__ import annotations

from collections.abc import Mapping

from sysid.gap import GapOptions, analyse
from sysid.studies.gapbench.cases import Answer, BenchCase, predicted


def answer(case: BenchCase) -> Answer:
    """Return the verdict of `sysid.gap` on a case, with its intervals and its predictions."""
    report = analyse(case.changed, case.model, GapOptions(next_experiment=False, fitted_on=case.nominal))
    effects = {
        effect.cause: {
            key: (p.value, p.low, p.high) for key, p in {**effect.parameters, **effect.estimates}.items()
        }
        for effect in report.effects
    }
    unseen: dict[str, Mapping[str, float]] = {entry.name: {} for entry in report.untestable}
    return Answer(
        report.verdict,
        effects,
        report.candidates if report.verdict == "ambiguous" else (),
        {**report.smallest_detectable, **unseen},
        predicted(report.model, case) if report.changed else (),
    )
