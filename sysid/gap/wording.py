"""What a study says in words: one sentence for terminal, page and JSON alike."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from mecanum_env.effects import CATALOGUE
from sysid.gap.result import Difference, GapReport, Interval, Region

NEXT_FILE: Final = "next_experiment.csv"
WHEEL_LAW: Final = "wheel_law"
"""Stands among the sets of effects for the law fitted again."""
SURE: Final = 0.01
"""Probability of chance below which a difference is one, however small."""
_CONCENTRATED: Final = 0.1
"""A region stands out if its share of the error is so much above its share of the samples."""


@dataclass(frozen=True)
class Concentration:
    """A region that holds more of a channel's error than of its samples."""

    region: Region
    sample_share: float
    """Part of the samples of the same dimension that lie in it."""

    @property
    def excess(self) -> float:
        """How much more of the error than of the samples it holds."""
        return self.region.share - self.sample_share


def verdict_sentence(report: GapReport) -> str:
    """Return what a study found, in one sentence."""
    gap = report.gap
    differ = amount(gap.before, gap.unit)
    if report.verdict == "no_gap" and report.p_value <= SURE:
        return (
            f"No gap worth a name: model and measurement differ by {differ}; what the effects could take off "
            f"is sure (p = {report.p_value:.2g}) but too little to matter."
        )
    if report.verdict == "no_gap" and not report.trusted:
        return (
            f"No effect of the catalogue is seen: model and measurement differ by {differ}, and how much of "
            f"that is noise is not known (p = {report.p_value:.2g})."
        )
    if report.verdict == "no_gap":
        return (
            f"No gap: model and measurement differ by {differ}, which noise and the model's own uncertainty "
            f"explain (p = {report.p_value:.2g})."
        )
    if report.verdict == "unexplained" and law_is_best(report):
        return (
            "There is a gap that the wheel law fitted again explains better than any effect of the catalogue "
            f"does: model and measurement differ by {differ}{_noise(gap)}."
        )
    if report.verdict == "unexplained":
        places = concentrations(report, most=1)
        where = f", most of all in {place_name(places[0].region)}" if places else ""
        return (
            f"There is a gap that no effect of the catalogue explains, alone or with others: model and "
            f"measurement differ by {differ}{_noise(gap)}{where}."
        )
    verb = "falls" if gap.after <= gap.before else "rises"
    change = (
        f"the difference on {compared_runs(report)} {verb} from {number(gap.before)} to "
        f"{amount(gap.after, gap.unit)}{_noise(gap)}"
    )
    if report.verdict == "named":
        names = listed([found.name for found in report.effects])
        return f"The model lacks {names}: with {_it(report)} {change}."
    sets = listed([set_name(names) for names in report.candidates], "or")
    return f"The model lacks {sets}, and these logs cannot tell which: with the first {change}."


def compared_runs(report: GapReport) -> str:
    """Return which runs the differences of a report are of, such as "unseen test runs"."""
    return "unseen test runs" if report.unseen else f"{report.held_out} runs (also used to decide)"


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


def law_is_best(report: GapReport) -> bool:
    """Return whether the wheel's own law, fitted again, did better than every set of effects."""
    return bool(report.evidence) and report.evidence[0].effects == (WHEEL_LAW,)


def closure(gap: Difference) -> float | None:
    """Return the part of a gap above the noise floor that was closed; None where nothing was above it."""
    floor = gap.noise_floor or 0.0
    if not (math.isfinite(gap.after) and gap.before > floor):
        return None
    return (gap.before - gap.after) / (gap.before - floor)


def concentrations(report: GapReport, most: int = 3) -> tuple[Concentration, ...]:
    """Return where the error of the worst channel stands out, at most one region a dimension.

    The worst channel is the one furthest above its noise (above the error that is left, where no noise is
    known). Wheels are compared across channels.

    Args:
        report: of the study.
        most: how many regions at most.
    """
    if not report.where:
        return ()
    there = {region.channel for region in report.where}
    worst = max(sorted(there), key=lambda name: _excess(report.channels.get(name)))
    best: dict[str, Concentration] = {}
    for found in _with_sample_share(report.where):
        region = found.region
        if region.channel != worst and region.dimension != "wheel":
            continue
        if region.dimension not in best or found.excess > best[region.dimension].excess:
            best[region.dimension] = found
    clear = [found for found in best.values() if found.excess > _CONCENTRATED]
    return tuple(sorted(clear, key=lambda found: -found.excess)[:most])


def closed_share(gap: Difference) -> str:
    """Return `closure` of a gap in percent; what lies below the noise by chance counts as all of it."""
    closed = closure(gap)
    return "-" if closed is None else f"{min(closed, 1.0):.0%}"


def place_name(region: Region) -> str:
    """Return a region in words, such as "speed_rpm, phase reversal"."""
    name = (
        region.region if region.region.startswith(region.dimension) else f"{region.dimension} {region.region}"
    )
    return f"{region.channel}, {name}"


def set_name(effects: Sequence[str]) -> str:
    """Return the name of a set of effects: joined by " + "; of none, "the model as it is"."""
    if tuple(effects) == (WHEEL_LAW,):
        return "the wheel law fitted again"
    return " + ".join(effects) if effects else "the model as it is"


def summary_of(effect: str) -> tuple[str, str]:
    """Return what an `effect` is and what it looks like in data, one line each."""
    if effect in CATALOGUE:
        return CATALOGUE[effect].summary, CATALOGUE[effect].signature
    return "", ""


def unit_of(effect: str, parameter: str) -> str:
    """Return the unit of an effect's parameter, empty for a pure number."""
    known = CATALOGUE[effect].parameters if effect in CATALOGUE else ()
    unit = next((p.unit for p in known if p.name == parameter), "")
    return "" if unit == "1" else unit


def sizes(effect: str, values: Mapping[str, float]) -> str:
    """Return parameters with units in a line, such as "gap_deg 2.1 deg".

    Args:
        effect: whose they are.
        values: parameter -> value.
    """
    return ", ".join(f"{name} {amount(value, unit_of(effect, name))}" for name, value in values.items())


def amount(value: float | None, unit: str) -> str:
    """Return a value with its unit to three digits; a dash where there is none."""
    text = number(value)
    return text if text == "-" or not unit else f"{text} {unit}"


def number(value: float | None) -> str:
    """Return a value to three digits; a dash where there is none."""
    if value is None or math.isnan(value):
        return "-"
    return f"{value:.0f}" if 1000.0 <= abs(value) < 1e6 else f"{value:.3g}"


def interval_text(estimate: Interval, unit: str) -> tuple[str, str]:
    """Return an estimate with its unit and its interval, to as many digits as the interval is wide.

    Args:
        estimate: value and interval.
        unit: of it.
    """
    width = estimate.high - estimate.low
    if not (0.0 < width < math.inf):
        return amount(estimate.value, unit), f"{number(estimate.low)} .. {number(estimate.high)}"
    decimals = max(0, 1 - math.floor(math.log10(width)))
    value, low, high = (f"{x:.{decimals}f}" for x in (estimate.value, estimate.low, estimate.high))
    return f"{value} {unit}".strip(), f"{low} .. {high}"


def count(many: int, what: str) -> str:
    """Return how many there are of `what`, such as "1 note", "2 notes"."""
    return f"{many} {what}" + ("" if many == 1 else "s")


def listed(words: Sequence[str], last: str = "and") -> str:
    """Return words as a list in a sentence.

    Args:
        words: at least one.
        last: stands before the last one.
    """
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}"


def _it(report: GapReport) -> str:
    return "it" if len(report.effects) == 1 else "them"


def _noise(gap: Difference) -> str:
    return "" if gap.noise_floor is None else f", where noise alone gives {number(gap.noise_floor)}"


def _excess(channel: Difference | None) -> float:
    if channel is None:
        return -math.inf
    scale = channel.noise_floor or channel.after
    return channel.before / scale if scale > 0.0 else channel.before


def _with_sample_share(where: Sequence[Region]) -> list[Concentration]:
    """Return every region beside its share of the samples of its dimension."""
    totals: dict[tuple[str, str], int] = {}
    for region in where:
        totals[_dimension(region)] = totals.get(_dimension(region), 0) + region.samples
    return [Concentration(region, region.samples / max(totals[_dimension(region)], 1)) for region in where]


def _dimension(region: Region) -> tuple[str, str]:
    return region.dimension, "" if region.dimension == "wheel" else region.channel
