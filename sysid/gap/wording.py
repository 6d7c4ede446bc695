"""What a study says in words: the sentences that all its outputs share, and how values are written."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.friction import droop_rpm, torques_of
from mecanum_env.kinematics import POSE, TWIST, WHEEL_SPEEDS
from mecanum_env.model import Model, cause_of, form_of
from sysid.gap.result import CustomProposal, Difference, GapReport, Interval, Region

NEXT_FILE: Final = "next_experiment.csv"
"""File with the commands of the next experiment."""
WHEEL_LAW: Final = "wheel_law"
"""Name among the sets of effects that stands for the wheel law, fitted again."""
_CONCENTRATED: Final = 0.1
"""A region stands out if its share of the error exceeds its share of the samples by this."""
_SPEED_UNITS: Final = ("rpm", "m/s", "rad/s")
_CHANNEL_GROUPS: Final[Mapping[str, tuple[str, ...]]] = {
    "the wheels' speeds": WHEEL_SPEEDS,
    "the body's velocity": TWIST,
    "the pose": POSE,
}
"""Channels that a robot may measure in addition, by what they are called in a sentence."""


@dataclass(frozen=True)
class Concentration:
    """A region that holds more of a channel's error than of its samples."""

    region: Region
    sample_share: float
    """Share of the dimension's samples that lie in the region."""

    @property
    def excess(self) -> float:
        """Share of the error minus share of the samples."""
        return self.region.share - self.sample_share


def verdict_sentence(report: GapReport) -> str:
    """Return what a study found, in one sentence."""
    gap = report.gap
    differ = f"model and measurement differ by {with_share(gap.before, gap)}"
    if report.verdict == "no_gap" and report.p_value <= report.false_alarm:
        return (
            f"No gap worth a name: {differ}; what the effects could remove is significant "
            f"(p = {report.p_value:.2g}) but too little to matter."
        )
    if report.verdict == "no_gap" and not report.trusted:
        return (
            f"No effect of the catalogue is seen: {differ}, and how much of that the model errs by itself "
            f"is not known (p = {report.p_value:.2g})."
        )
    if report.verdict == "no_gap":
        return (
            f"No gap: {differ}, which noise and the model's own uncertainty explain "
            f"(p = {report.p_value:.2g})."
        )
    if report.verdict == "unexplained" and _law_is_best(report):
        return (
            "There is a gap that the wheel law fitted again explains better than any effect of the catalogue "
            f"does: {differ}{_noise(gap)}."
        )
    if report.verdict == "unexplained":
        places = concentrations(report, most=1)
        where = f", most of all in {place_name(places[0].region)}" if places else ""
        return (
            f"There is a gap that no effect of the catalogue explains, alone or with others: {differ}"
            f"{_noise(gap)}{where}."
        )
    change = (
        f"the difference on {compared_runs(report)} {'falls' if gap.after <= gap.before else 'rises'} from "
        f"{number(gap.before)} to {with_share(gap.after, gap)}{_noise(gap)}"
    )
    if report.verdict == "named":
        them = "it" if len(report.effects) == 1 else "them"
        return f"The model lacks {listed(effect_name(e.name) for e in report.effects)}: with {them} {change}."
    sets = listed(map(set_name, report.candidates), "or")
    return f"The model lacks {sets}, and these logs cannot tell which: with the first {change}."


def next_step(report: GapReport) -> str:
    """Return what to do now, in a sentence."""
    experiment = report.next_experiment
    if experiment is not None:
        gives = "names the truth" if experiment.candidates else "shows what these logs could not"
        return (
            f"run {NEXT_FILE} ({experiment.duration_s:.3g} s, three times; {gives} with a "
            f"probability of {experiment.power:.0%}), add the recordings, in dataset.toml with "
            'split = "fit", and study again'
        )
    if report.verdict == "no_gap":
        return "nothing to do; harder or longer runs may show what these do not"
    if report.verdict == "named" and report.gap.after > report.gap.before:
        return "let more logs confirm the new model.json before using it: on these runs its error is larger"
    if report.verdict == "named":
        return "use the new model.json; study again with it to see whether anything is left"
    if report.verdict == "ambiguous":
        return what_to_measure(report.candidates, tuple(report.channels))
    if _law_is_best(report):
        return "fit the wheel again with these logs (python -m sysid.fit), then study the new model"
    if report.custom is not None and report.custom.adopted:
        return "verify the new model.json on other logs; its custom effect describes and does not explain"
    return "look at the worst runs on the page; the regions say what the robot was doing"


def proposal_text(custom: CustomProposal) -> str:
    """Return a proposed custom effect in a line: station, formula, and what it explains."""
    where = " or ".join((custom.effect.station, *custom.stations_tied))
    return f"custom effect at {where}: {custom.effect.text} [rpm] ({custom.explained:.0%} of the difference)"


def what_to_measure(sets: Sequence[Sequence[str]], channels: Sequence[str]) -> str:
    """Return, as the end of a sentence, what to measure besides `channels` to tell sets of effects apart."""
    shared = set(sets[0]).intersection(*sets[1:])
    differing = [CATALOGUE[n] for names in sets for n in names if n not in shared and n in CATALOGUE]
    checks = dict.fromkeys(effect.direct_check for effect in differing if effect.direct_check)
    missing = [what for what, names in _CHANNEL_GROUPS.items() if not set(names) & set(channels)]
    if tuple(channels) == ("speed_rpm",):
        missing = ["the body of the whole robot on the floor"]
    ways = [f"measure {'; or '.join(checks)}"] if checks else []
    ways += [f"log {listed(missing)} too"] if missing else []
    return "; or ".join(ways) if ways else "measure with a second, independent sensor"


def compared_runs(report: GapReport) -> str:
    """Return which runs the differences of a report are of, such as "unseen test runs"."""
    return "unseen test runs" if report.unseen else f"{report.held_out} runs (also used to decide)"


def _law_is_best(report: GapReport) -> bool:
    """Return whether the wheel's own law, fitted again, did better than every set of effects."""
    return bool(report.evidence) and report.evidence[0].effects == (WHEEL_LAW,)


def closure(gap: Difference) -> float | None:
    """Return the share of a gap above the noise floor that was closed; None if nothing was above it."""
    floor = gap.noise_floor or 0.0
    if not (math.isfinite(gap.after) and gap.before > floor):
        return None
    return (gap.before - gap.after) / (gap.before - floor)


def closed_share(gap: Difference) -> str:
    """Return the closure of a gap in percent, 100% if the noise floor is reached, "none" if the gap grew."""
    closed = closure(gap)
    if closed is None:
        return "-"
    return "none" if closed < 0.0 else f"{min(closed, 1.0):.0%}"


def concentrations(report: GapReport, most: int = 3) -> tuple[Concentration, ...]:
    """Return where the error of the worst channel stands out: one region per dimension, `most` in all.

    Regions of the dimension "wheel" compare channels and are always considered.
    """
    if not report.where:
        return ()
    worst = worst_channel(report)
    best: dict[str, Concentration] = {}
    for found in _with_sample_share(report.where):
        region = found.region
        if region.channel != worst and region.dimension != "wheel":
            continue
        if region.dimension not in best or found.excess > best[region.dimension].excess:
            best[region.dimension] = found
    clear = [found for found in best.values() if found.excess > _CONCENTRATED]
    return tuple(sorted(clear, key=lambda found: -found.excess)[:most])


def worst_channel(report: GapReport) -> str:
    """Return the channel with the largest error relative to its noise, or to the error left without repeats.

    The report must have at least one region.
    """

    def excess(name: str) -> float:
        channel = report.channels[name]
        scale = channel.noise_floor or channel.after
        return channel.before / scale if scale > 0.0 else channel.before

    return max(sorted({region.channel for region in report.where}), key=excess)


def place_name(region: Region) -> str:
    """Return a region in words, such as "speed_rpm, phase reversal"."""
    name = region.region
    return f"{region.channel}, {name if name.startswith(region.dimension) else f'{region.dimension} {name}'}"


def effect_name(effect: str) -> str:
    """Return an effect in words: its cause, and its form if that is not the first ("backlash (spring)")."""
    cause = cause_of(effect)
    return effect if effect == cause else f"{cause} ({form_of(effect)})"


def set_name(effects: Sequence[str]) -> str:
    """Return the name of a set of effects: joined by " + "; of none, "the model as it is"."""
    if tuple(effects) == (WHEEL_LAW,):
        return "the wheel law fitted again"
    return " + ".join(map(effect_name, effects)) if effects else "the model as it is"


def summary_of(effect: str) -> tuple[str, str]:
    """Return what an `effect` is and what it looks like in data, one line each."""
    known = CATALOGUE.get(effect)
    return ("", "") if known is None else (known.summary, known.signature)


def unit_of(effect: str, parameter: str) -> str:
    """Return the unit of an effect's parameter, empty for a pure number."""
    if parameter == "droop_rpm":
        return "rpm"
    known = CATALOGUE[effect].parameters if effect in CATALOGUE else ()
    unit = next((p.unit for p in known if p.name == parameter), "")
    return "" if unit == "1" else unit


def sizes(effect: str, values: Mapping[str, float]) -> str:
    """Return the values of an effect's parameters with their units in a line, such as "gap_deg 2.1 deg"."""
    return ", ".join(f"{name} {amount(value, unit_of(effect, name))}" for name, value in values.items())


def sizes_in(model: Model, effect: str) -> str:
    """Return the parameters of an effect of a model; of a torque the speed that it takes from the drive."""
    values = model.effects[effect]
    if values.keys() & set(torques_of(effect)):
        return amount(droop_rpm(effect, values, model), "rpm")
    return sizes(effect, values)


def with_share(value: float, gap: Difference) -> str:
    """Return an rms error with its share of the motion, such as "23 rpm (12% of the rms speed)".

    Without a known motion of the gap the error stands alone.
    """
    share = percent_of_motion(value, gap)
    kind = "speed" if gap.unit in _SPEED_UNITS else "motion"
    return amount(value, gap.unit) + (f" ({share} of the rms {kind})" if share else "")


def percent_of_motion(value: float, gap: Difference) -> str:
    """Return an rms error in percent of the rms motion; empty if that is zero or not known."""
    if not gap.motion or not math.isfinite(value):
        return ""
    share = value / gap.motion
    return f"{share:.0%}" if share >= 0.1 else f"{share:.1%}"


def amount(value: float | None, unit: str) -> str:
    """Return a value with its unit to three digits; a dash for None and NaN."""
    text = number(value)
    return text if text == "-" or not unit else f"{text} {unit}"


def number(value: float | None) -> str:
    """Return a value to three digits; a dash for None and NaN."""
    if value is None or math.isnan(value):
        return "-"
    return f"{value:.0f}" if 1000.0 <= abs(value) < 1e6 else f"{value:.3g}"


def interval_text(estimate: Interval, unit: str) -> tuple[str, str]:
    """Return an estimate [unit] and its interval, with two digits for the width of the interval."""
    width = estimate.high - estimate.low
    if not (0.0 < width < math.inf):
        return amount(estimate.value, unit), f"{number(estimate.low)} .. {number(estimate.high)}"
    decimals = max(0, 1 - math.floor(math.log10(width)))
    value, low, high = (f"{x:.{decimals}f}" for x in (estimate.value, estimate.low, estimate.high))
    return f"{value} {unit}".strip(), f"{low} .. {high}"


def count(many: int, what: str) -> str:
    """Return `many` of `what` in words, such as "1 note" or "2 notes"."""
    return f"{many} {what}" + ("" if many == 1 else "s")


def listed(words: Iterable[str], last: str = "and") -> str:
    """Return words, at least one, as a list in a sentence, with a conjunction before the last one."""
    *first, end = words
    return f"{', '.join(first)} {last} {end}" if first else end


def _noise(gap: Difference) -> str:
    return "" if gap.noise_floor is None else f", where noise alone gives {number(gap.noise_floor)}"


def _with_sample_share(where: Sequence[Region]) -> list[Concentration]:
    """Return every region with its share of the samples of its dimension."""
    keys = [(r.dimension, "" if r.dimension == "wheel" else r.channel) for r in where]
    totals: dict[tuple[str, str], int] = {}
    for key, region in zip(keys, where, strict=True):
        totals[key] = totals.get(key, 0) + region.samples
    return [Concentration(r, r.samples / max(totals[key], 1)) for key, r in zip(keys, where, strict=True)]
