"""The study of this project: which effects the simulator lacks, and what adding them gains."""

from __future__ import annotations

from collections.abc import Mapping

from mecanum_env.model import cause_of
from sysid.gap import GapOptions, analyse
from sysid.gap.search.known_effects import known_effects
from sysid.studies.gapbench.cases import Answer, BenchCase, predicted
from sysid.studies.gapbench.names import named_effects


def answer(case: BenchCase) -> Answer:
    """Return the verdict of `sysid.gap` on a case, with its intervals and its predictions."""
    # As every method, it may use the names of the list only.
    allowed = {effect.cause for effect in named_effects()}
    others = tuple(name for name in known_effects("bench") if cause_of(name) not in allowed)
    options = GapOptions(next_experiment=False, fitted_on=case.nominal, exclude=others)
    report = analyse(case.changed, case.model, options)
    effects = {
        effect.cause: {
            key: (p.value, p.low, p.high) for key, p in {**effect.parameters, **effect.estimates}.items()
        }
        for effect in report.new_effects
    }
    unseen: dict[str, Mapping[str, float]] = {entry.name: {} for entry in report.untestable}
    return Answer(
        report.verdict,
        effects,
        report.candidates if report.verdict == "ambiguous" else (),
        {**report.smallest_detectable, **unseen},
        predicted(report.model, case) if report.changed else (),
    )
