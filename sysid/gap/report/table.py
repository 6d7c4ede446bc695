"""The terminal's view of a study: ten lines."""

from __future__ import annotations

from collections.abc import Sequence

from sysid.gap.report.wording import (
    amount,
    closed_share,
    concentrations,
    count,
    interval_text,
    law_is_best,
    number,
    place_name,
    set_name,
    unit_of,
    verdict_sentence,
)
from sysid.gap.result import Difference, FoundEffect, GapReport

_MOST_CHANNELS, _MOST_NAMES = 4, 4
NEXT_FILE = "next_experiment.csv"


def gap_table(report: GapReport) -> str:
    """Return what a study found in at most ten lines, the verdict first."""
    rows = [
        ("gap", _gap(report)),
        ("channels", _channels(report) if len(report.channels) > 1 else ""),
        ("where most", _where(report)),
        ("missing", "; ".join(_effect(found) for found in report.effects)),
        ("tied", " | ".join(set_name(names) for names in report.candidates[:_MOST_NAMES])
         if len(report.candidates) > 1 else ""),
        ("tried", _tried(report)),
        ("clue", _clue(report)),
        ("untestable", _untestable(report)),
        ("noticed", _noticed(report)),
        ("next", next_step(report)),
    ]  # fmt: skip
    there = [f"{name:<11}{text}" for name, text in rows if text]
    return "\n".join([f"{report.dataset}: {verdict_sentence(report)}", *there[:9]])


def next_step(report: GapReport) -> str:
    """Return what to do now, in a sentence."""
    experiment = report.next_experiment
    if experiment is not None:
        gives = "names the truth" if experiment.candidates else "shows what these logs could not"
        return (
            f"run {NEXT_FILE} ({experiment.duration_s:.3g} s, three times; {gives} with a "
            f"probability of {experiment.power:.0%}), add the logs and study again"
        )
    if report.verdict == "no_gap":
        return "nothing to do; harder or longer runs may show what these do not"
    if report.verdict == "named":
        return "use the new model.json; study again with it to see whether anything is left"
    if report.verdict == "ambiguous":
        return "record other commands; these cannot tell the candidates apart"
    if law_is_best(report):
        return "fit the wheel again with these logs (python -m sysid.fit), then study the new model"
    return "look at the worst runs on the page; the regions say what the robot was doing"


def _gap(report: GapReport) -> str:
    gap = report.gap
    closed = closed_share(gap) if report.effects else "-"
    end = f"; {closed} of what is above noise is gone" if closed != "-" else ""
    return f"{_change(gap)} on runs that no decision has seen{end}"


def _change(gap: Difference) -> str:
    floor = "" if gap.noise_floor is None else f" (noise {number(gap.noise_floor)})"
    return f"{number(gap.before)} -> {amount(gap.after, gap.unit)}{floor}"


def _channels(report: GapReport) -> str:
    items = [f"{name} {_change(channel)}" for name, channel in report.channels.items()]
    return _shortened(items, _MOST_CHANNELS, ", ")


def _where(report: GapReport) -> str:
    return "; ".join(
        f"{place_name(found.region)}: "
        f"{found.region.share:.0%} of the error in {found.sample_share:.0%} of the samples"
        for found in concentrations(report, most=2)
    )


def _effect(found: FoundEffect) -> str:
    texts = {name: interval_text(p, unit_of(found.name, name)) for name, p in found.parameters.items()}
    values = ", ".join(f"{name} {value} ({interval})" for name, (value, interval) in texts.items())
    return f"{found.name} {values}, in {found.selection_frequency:.0%} of resamples"


def _tried(report: GapReport) -> str:
    adequate = sum(evidence.adequate for evidence in report.evidence)
    return f"{count(len(report.evidence), 'set')} of effects; explain the data: {adequate}"


def _clue(report: GapReport) -> str:
    if report.empirical is None:
        return ""
    parts = [
        f"{channel} {text} ({report.empirical.explained.get(channel, 0.0):.0%} of the error)"
        for channel, text in report.empirical.formula.items()
    ]
    added = ", added to the model" if report.empirical.adopted else ""
    return f"{'; '.join(parts)}: by regression, not physics{added}"


def _untestable(report: GapReport) -> str:
    names = [effect.name for effect in report.untestable]
    return f"{count(len(names), 'effect')}: {_shortened(names, _MOST_NAMES, ', ')}" if names else ""


def _noticed(report: GapReport) -> str:
    kinds = sorted({finding.kind for finding in report.findings})
    counts = [count(len(report.notes), "note") if report.notes else "", ", ".join(kinds)]
    return "; ".join(filter(None, counts))


def _shortened(items: Sequence[str], most: int, glue: str) -> str:
    more = f"{glue}and {len(items) - most} more" if len(items) > most else ""
    return glue.join(items[:most]) + more
