"""A certificate as text and as an HTML page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from mecanum_env.report import figure, write_page
from training.certify.certificate import Certificate
from training.certify.checks import Check, milliseconds, share_text, warning_text
from training.certify.results import VariantResult
from training.evaluate import Mean, Share

HEAD: Final = (
    *("plant", "success", "bound", "of it", "change", "most fail by"),
    *("settling", "overshoot", "saturated", "speed error"),
)
"""Head of the table of plants."""
_TEMPLATE: Final = Path(__file__).with_name("page.html")
_BLUE, _RED, _GREY, _BAND = "#1f5fa8", "#c0392b", "#888888", "rgba(31,95,168,0.15)"
_ROW_PX, _MARGIN_PX, _LEAST_PX = 22, 90, 230
"""Height of a plant in its figure, of what surrounds the plants, and of the figure with its zoom buttons."""


def certificate_table(certificate: Certificate) -> str:
    """Return a certificate as text: plants, techniques, checks, verdict."""
    c = certificate
    techniques = ", ".join(f"{name} {share_text(one)}" for name, one in c.nominal.by_technique.items())
    known = [plant for plant in c.plants if plant not in c.held_out]
    blocks = columns([HEAD, *map(_plant_row, known), *map(_plant_row, c.held_out)])
    if c.held_out:
        blocks[1 + len(known) : 1 + len(known)] = ["", "held out, seen by no training:"]
    lines = [
        f"{c.controller}: {c.provenance['episodes']} episodes a plant, level {c.provenance['difficulty']}",
        "",
        *blocks,
        "",
        f"by technique, nominal: {techniques}",
        "",
        *columns([("check", "found", "must be", ""), *map(_check_row, c.all_checks)]),
        *(f"note: {note}" for note in c.notes),
        "",
        verdict(c),
    ]
    return "\n".join(lines)


def verdict(certificate: Certificate) -> str:
    """Return in one sentence whether a certificate is passed, or which checks failed."""
    checks = certificate.all_checks
    failed = [check.name for check in checks if not (check.passed or check.undecided)]
    undecided = [check for check in checks if check.undecided]
    if failed:
        return f"FAIL: {certificate.controller} misses {', '.join(failed)}."
    if undecided:
        needs = ", ".join(f"{one.name} ({one.mark.removeprefix('undecided: ')})" for one in undecided)
        return f"UNDECIDED: {certificate.controller} misses nothing, but needs more: {needs}."
    return f"PASS: {certificate.controller} meets all {len(checks)} thresholds."


def columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of cells as lines of aligned columns."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return ["  ".join(f"{cell:{w}}" for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows]


def _plant_row(plant: VariantResult) -> tuple[str, ...]:
    """Return the cells of a plant, as in `HEAD`."""
    reason, count = next(iter(plant.failures.items()), ("-", 0))
    change = "-"
    if plant.change is not None:
        # Adding 0.0 turns -0.0 into 0.0.
        ends = (plant.change.value, plant.change.low, plant.change.high)
        change = "{:+.2f} ({:+.2f} .. {:+.2f})".format(*(round(x, 2) + 0.0 for x in ends))
    return (
        plant.name + (" (rollers)" if plant.physics == "rollers" else ""),
        share_text(plant.success),
        "-" if plant.bound is None else share_text(plant.bound),
        "-" if plant.share_of_bound is None else f"{plant.share_of_bound:.0%}",
        change,
        f"{reason} {count}" if count else "-",
        _mean_text(plant.settling_s, "s"),
        _mean_text(plant.overshoot, ""),
        f"{plant.saturated_share.value:.0%}",
        _mean_text(plant.speed_error_m_s, "m/s"),
    )


def _check_row(check: Check) -> tuple[str, ...]:
    """Return the cells of a check: name, metric, limit, verdict."""
    limit = f"{check.sense} {check.limit:g} {check.unit}".rstrip()
    return check.name, check.text, limit, check.mark


def _mean_text(found: Mean | None, unit: str) -> str:
    return "-" if found is None else f"{found.value:.2f}{' ' * bool(unit)}{unit}"


def write_certificate_page(certificate: Certificate, path: Path) -> None:
    """Write a certificate as an HTML page."""
    c = certificate
    timing = (
        f"{c.timing.commands} commands were timed. Half of them took up to {milliseconds(c.timing.p50_s)} of "
        f"processor time, 99 of 100 up to {milliseconds(c.timing.p99_s)}, the longest "
        f"{milliseconds(c.timing.longest_s)}; the robot takes a command every 100 ms."
    )
    write_page(
        path,
        _TEMPLATE,
        {"warning": warning_figure(c), "plants": _plants_figure(c), "techniques": _techniques_figure(c)},
        controller=c.controller,
        passed=c.passed,
        verdict=verdict(c),
        target=f"{c.warning.target:.0%}",
        warning=warning_text(c.warning),
        shortest=f"{c.warning.range_s[0]:g}",
        longest=f"{c.warning.range_s[1]:g}",
        reached=c.warning.needed_s is not None,
        nominal=share_text(c.nominal.success),
        worst=c.worst,
        worst_text=share_text(c.worst.success),
        checks=[(*_check_row(check), check.passed) for check in c.all_checks],
        head=HEAD,
        held_out=", ".join(plant.name for plant in c.held_out),
        plants=[_plant_row(plant) for plant in c.plants],
        summaries=[(plant.name, plant.summary) for plant in c.plants],
        failures=list(c.nominal.failures.items()),
        episodes=c.provenance["episodes"],
        timing=timing,
        notes=c.notes,
        provenance=list(c.provenance.items()),
    )


def warning_figure(certificate: Certificate) -> dict[str, Any]:
    """Return a certificate's success against warning time as a Plotly figure."""
    curve = certificate.warning
    grid, middles = list(curve.warning_s), [0.5 * (one.from_s + one.to_s) for one in curve.bins]
    traces = [
        {
            "type": "scatter",
            "x": grid + grid[::-1],
            "y": [*curve.high, *curve.low[::-1]],
            "fill": "toself",
            "fillcolor": _BAND,
            "line": {"width": 0},
            "hoverinfo": "skip",
            "name": "95 % interval",
        },
        {
            "type": "scatter",
            "mode": "lines",
            "x": grid,
            "y": list(curve.success),
            "line": {"color": _BLUE, "width": 2},
            "name": "local logistic fit",
        },
        _points(middles, [one.success for one in curve.bins], "episodes counted"),
    ]
    shapes = [_line({"y0": curve.target, "y1": curve.target, "x0": 0, "x1": 1, "xref": "paper"})]
    if curve.needed_s is not None:
        shapes.append(_line({"x0": curve.needed_s, "x1": curve.needed_s, "y0": 0, "y1": curve.target}))
    layout = {
        "shapes": shapes,
        "yaxis": {"title": {"text": "success"}, "range": [-0.02, 1.02]},
    }
    x_title = "warning: from the first visible motion to the hit [s]"
    return figure(traces, x=x_title, height=380, layout=layout)


def _plants_figure(certificate: Certificate) -> dict[str, Any]:
    """Return a certificate's success by plant as a Plotly figure; the worst plant is red."""
    plants, limits = certificate.plants[::-1], certificate.thresholds
    trace = _points([one.success.value for one in plants], [one.success for one in plants], "", across=True)
    trace["y"] = [one.name for one in plants]
    worst = certificate.worst.name
    trace["marker"]["color"] = [_RED if one.name == worst else _BLUE for one in plants]
    ends = {"y0": 0, "y1": 1, "yref": "paper"}
    layout = {
        "shapes": [_line({"x0": x, "x1": x, **ends}) for x in (limits.success, limits.worst_success)],
        "xaxis": {"title": {"text": "success"}, "range": [-0.02, 1.02]},
        "yaxis": {"automargin": True, "dtick": 1},
        "showlegend": False,
    }
    return figure([trace], height=max(_LEAST_PX, _MARGIN_PX + _ROW_PX * len(plants)), layout=layout)


def _techniques_figure(certificate: Certificate) -> dict[str, Any]:
    """Return a certificate's success by technique, on the nominal and the worst plant, as a Plotly figure."""
    traces = []
    shown = [("nominal", certificate.nominal, _BLUE), (certificate.worst.name, certificate.worst, _RED)]
    for i, (name, plant, colour) in enumerate(shown if len(certificate.plants) > 1 else shown[:1]):
        places = [place + 0.12 * (2 * i - 1) for place in range(len(plant.by_technique))]
        trace = _points(places, list(plant.by_technique.values()), name)
        trace["marker"]["color"] = colour
        traces.append(trace)
    names = list(certificate.nominal.by_technique)
    layout = {
        "xaxis": {"tickvals": list(range(len(names))), "ticktext": names, "zeroline": False},
        "yaxis": {"title": {"text": "success"}, "range": [-0.02, 1.02]},
    }
    return figure(traces, height=300, layout=layout)


def _points(places: list[float], shares: list[Share], name: str, *, across: bool = False) -> dict[str, Any]:
    """Return shares as a trace of points with their intervals; `across`: along the x axis."""
    values = [one.value for one in shares]
    bars = {
        "type": "data",
        "symmetric": False,
        "array": [one.high - one.value for one in shares],
        "arrayminus": [one.value - one.low for one in shares],
        "color": _GREY,
        "thickness": 1.2,
        "width": 3,
    }
    return {
        "type": "scatter",
        "mode": "markers",
        "x": places,
        "y": values,
        "error_x" if across else "error_y": bars,
        "marker": {"color": _BLUE, "size": 8},
        "text": [f"{share.successes} of {share.trials}" for share in shares],
        "name": name,
    }


def _line(ends: dict[str, Any]) -> dict[str, Any]:
    return {"type": "line", "line": {"color": _GREY, "width": 1, "dash": "dot"}, **ends}
