"""The page of a certificate."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from mecanum_env.report import figure, report_available, write_page
from training.certify.judge import share_text, warning_text
from training.certify.records import Certificate
from training.certify.table import HEAD, all_checks, check_row, plant_row, timing_text, verdict
from training.evaluate import Share

_TEMPLATE: Final = Path(__file__).parent / "templates" / "certificate.html"
_BLUE, _RED, _GREY, _BAND = "#1f5fa8", "#c0392b", "#888888", "rgba(31,95,168,0.15)"
# On the left: on the right are the buttons that zoom.
_LEGEND: Final = {"orientation": "h", "x": 0.0, "xanchor": "left", "y": 1.0, "yanchor": "bottom"}
_ROW_PX, _MARGIN_PX = 22, 90


def write_certificate_page(certificate: Certificate, path: Path) -> bool:
    """Write the page of a certificate; return False, writing nothing, without the `report` extra.

    Args:
        certificate: what is shown.
        path: of the page.
    """
    if not report_available():
        return False
    c = certificate
    write_page(
        path,
        _TEMPLATE,
        {"warning": warning_figure(c), "plants": plants_figure(c), "techniques": techniques_figure(c)},
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
        checks=[(*check_row(check), check.passed) for check in all_checks(c)],
        head=HEAD,
        plants=[plant_row(plant) for plant in c.plants],
        summaries=[(plant.name, plant.summary) for plant in c.plants],
        failures=[(reason, count) for reason, count in c.nominal.failures.items()],
        episodes=c.provenance["episodes"],
        timing=timing_text(c),
        notes=c.notes,
        provenance=list(c.provenance.items()),
    )
    return True


def warning_figure(certificate: Certificate) -> dict[str, Any]:
    """Return success against warning time of a certificate, as a Plotly figure."""
    curve = certificate.warning
    grid = list(curve.warning_s)
    middles = [0.5 * (one.from_s + one.to_s) for one in curve.bins]
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
        "legend": _LEGEND,
    }
    return figure(
        traces, x="warning: from the first visible motion to the hit [s]", height=380, layout=layout
    )


def plants_figure(certificate: Certificate) -> dict[str, Any]:
    """Return success plant by plant of a certificate, as a Plotly figure."""
    plants = certificate.plants[::-1]
    thresholds = certificate.thresholds
    trace = _points([one.success.value for one in plants], [one.success for one in plants], "", across=True)
    trace["y"] = [one.name for one in plants]
    trace["marker"]["color"] = [
        _RED if one.name == certificate.worst.name else _BLUE for one in plants
    ]  # the worst stands out
    limits = (thresholds.success, thresholds.worst_success)
    layout = {
        "shapes": [_line({"x0": x, "x1": x, "y0": 0, "y1": 1, "yref": "paper"}) for x in limits],
        "xaxis": {"title": {"text": "success"}, "range": [-0.02, 1.02]},
        "yaxis": {"automargin": True, "dtick": 1},
        "showlegend": False,
    }
    return figure([trace], height=_MARGIN_PX + _ROW_PX * len(plants), layout=layout)


def techniques_figure(certificate: Certificate) -> dict[str, Any]:
    """Return success by technique, nominal and worst plant of a certificate, as a Plotly figure."""
    traces = []
    shown = [("nominal", certificate.nominal, _BLUE), (certificate.worst.name, certificate.worst, _RED)]
    for i, (name, plant, colour) in enumerate(shown if len(certificate.plants) > 1 else shown[:1]):
        names = list(plant.by_technique)
        trace = _points(list(range(len(names))), list(plant.by_technique.values()), name)
        trace["x"] = [place + 0.12 * (2 * i - 1) for place in range(len(names))]
        trace["marker"]["color"] = colour
        traces.append(trace)
    names = list(certificate.nominal.by_technique)
    layout = {
        "xaxis": {"tickvals": list(range(len(names))), "ticktext": names, "zeroline": False},
        "yaxis": {"title": {"text": "success"}, "range": [-0.02, 1.02]},
        "legend": _LEGEND,
    }
    return figure(traces, height=300, layout=layout)


def _points(places: list[float], shares: list[Share], name: str, *, across: bool = False) -> dict[str, Any]:
    """Return shares as points with their intervals."""
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
