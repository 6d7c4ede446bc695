"""The page of a gap study: what the template `page.html` shows."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from mecanum_env.model import cause_of
from mecanum_env.report import write_page
from sysid.gap.report.plots import experiment_figure, heat_figure, heat_scale, heat_width_px, overlay_figure
from sysid.gap.result import Difference, Evidence, FoundEffect, GapReport
from sysid.gap.wording import (
    amount,
    closed_share,
    compared_runs,
    concentrations,
    effect_name,
    interval_text,
    next_step,
    number,
    percent_of_motion,
    place_name,
    set_name,
    sizes,
    summary_of,
    unit_of,
    verdict_sentence,
)

_TEMPLATE: Final = Path(__file__).with_name("page.html")
_MOST_FINDINGS: Final = 40
_EVIDENCE_SHOWN, _EVIDENCE_FOLDED = 10, 60
"""Sets of effects in the table of evidence, and in the part that opens on a click."""
_MOST_CANDIDATES: Final = 6
_BESIDE: Final = "beside the logs of the fit"


def write_gap_report(report: GapReport, path: Path) -> None:
    """Write the page of a study to a path, which takes the `report` extra."""
    experiment, beside = report.next_experiment, report.gap_beside_fit
    rows = [*report.channels.items(), *([] if beside is None else [(_BESIDE, beside)])]
    overlays = {f"run{i}": overlay_figure(overlay) for i, overlay in enumerate(report.overlays)}
    figures: dict[str, Mapping[str, Any]] = dict(overlays)
    if (heat := heat_figure(report)) is not None:
        figures["heat"] = heat
    if experiment is not None:
        figures["experiment"] = experiment_figure(experiment)
    write_page(
        path,
        _TEMPLATE,
        figures,
        dataset=report.dataset,
        level=report.level,
        verdict=report.verdict,
        sentence=verdict_sentence(report),
        step=next_step(report),
        gap=_difference_row("together", report.gap),
        beside=None if beside is None else _difference_row(_BESIDE, beside),
        runs=compared_runs(report),
        changed=report.changed,
        rows=[_difference_row(name, one) for name, one in rows],
        effects=[_effect(found) for found in report.effects],
        candidates=[_candidate(report, names) for names in report.candidates[:_MOST_CANDIDATES]],
        more_candidates=max(0, len(report.candidates) - _MOST_CANDIDATES),
        places=[
            (place_name(c.region), f"{c.region.share:.0%}", f"{c.sample_share:.0%}")
            for c in concentrations(report)
        ],
        overlays=list(overlays),
        heat=heat is not None,
        heat_unit=heat_scale(report)[1],
        heat_width_px=heat_width_px(report),
        evidence=_evidence(report),
        evidence_shown=_EVIDENCE_SHOWN,
        evidence_left=max(0, len(report.evidence) - _EVIDENCE_FOLDED),
        unit=report.gap.unit,
        untestable=[(u.name, u.reason, sizes(u.name, u.smallest_detectable)) for u in report.untestable],
        detectable=[(name, sizes(name, values)) for name, values in report.smallest_detectable.items()],
        experiment=experiment,
        power="" if experiment is None else f"{experiment.power:.0%}",
        separated=[] if experiment is None else [set_name(names) for names in experiment.candidates],
        custom=_custom(report),
        findings=report.findings[:_MOST_FINDINGS],
        notes=report.notes,
        provenance=[(name, str(value)) for name, value in report.provenance.items()],
    )


def _difference_row(name: str, gap: Difference) -> dict[str, Any]:
    """Return the cells of a difference, and the lengths of its bars in percent of the longest."""
    percent = 100.0 / (max(gap.before, gap.after, gap.noise_floor or 0.0) or 1.0)
    return {
        "name": name,
        "unit": gap.unit,
        "before": number(gap.before),
        "after": number(gap.after),
        "floor": number(gap.noise_floor),
        "before_share": percent_of_motion(gap.before, gap),
        "after_share": percent_of_motion(gap.after, gap),
        "closed": closed_share(gap),
        "before_length": f"{percent * gap.before:.1f}",
        "after_length": f"{percent * gap.after:.1f}",
        "floor_length": "" if gap.noise_floor is None else f"{percent * gap.noise_floor:.1f}",
    }


def _effect(found: FoundEffect) -> dict[str, Any]:
    summary, signature = summary_of(found.name)
    return {
        "name": effect_name(found.name),
        "summary": summary,
        "signature": signature,
        "frequency": f"{found.selection_frequency:.0%}",
        "parameters": [
            (name, *interval_text(p, unit_of(found.name, name))) for name, p in found.estimates.items()
        ],
    }


def _candidate(report: GapReport, names: tuple[str, ...]) -> dict[str, Any]:
    fitted = next((e for e in report.evidence if set(map(cause_of, e.effects)) == set(names)), None)
    return {
        "name": set_name(names),
        "summaries": [summary_of(name)[0] for name in names],
        "sizes": _all_sizes(fitted) if fitted else "",
    }


def _evidence(report: GapReport) -> list[dict[str, Any]]:
    """Return the rows of the best sets and of the model as it is."""
    adopted = {found.name for found in report.effects}
    tied = [set(names) for names in report.candidates]

    def mark(e: Evidence) -> str:
        if adopted and set(e.effects) == adopted:
            return "adopted"
        return "tied" if set(map(cause_of, e.effects)) in tied else ""

    unchanged = [e for e in report.evidence[_EVIDENCE_FOLDED:] if not e.effects]
    return [
        {
            "name": set_name(e.effects),
            "sizes": _all_sizes(e),
            "mark": mark(e),
            "count": e.parameter_count,
            "score": number(e.score),
            "misfit": number(e.misfit),
            "adequate": "yes" if e.adequate else "no",
            "validation": number(e.validation_rms),
            "test": number(e.test_rms),
            "bic": number(e.bic),
        }
        for e in [*report.evidence[:_EVIDENCE_FOLDED], *unchanged]
    ]


def _all_sizes(evidence: Evidence) -> str:
    return "; ".join(filter(None, (sizes(name, values) for name, values in evidence.parameters.items())))


def _custom(report: GapReport) -> dict[str, Any] | None:
    if report.custom is None:
        return None
    effect, ends = report.custom.effect, report.custom.effect.range.items()
    return {
        "adopted": report.custom.adopted,
        "station": effect.station,
        "text": effect.text,
        "explained": f"{report.custom.explained:.0%}",
        "after": amount(report.custom.after, report.gap.unit),
        "tied": report.custom.stations_tied,
        "ranges": [f"{name} {low:g} .. {high:g}" for name, (low, high) in ends],
    }
