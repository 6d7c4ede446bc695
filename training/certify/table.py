"""The terminal's view of a certificate."""

from __future__ import annotations

from collections.abc import Sequence

from training.certify.judge import milliseconds, share_text
from training.certify.records import Certificate, Check, PlantFigures
from training.evaluate import Mean

HEAD = ("plant", "success", "change", "most fail by", "settling", "overshoot", "saturated", "speed error")
"""Of the table of plants."""


def certificate_table(certificate: Certificate) -> str:
    """Return a certificate as text: plants, techniques, warning, checks, verdict."""
    c = certificate
    techniques = ", ".join(f"{name} {share_text(one)}" for name, one in c.nominal.by_technique.items())
    lines = [
        f"{c.controller}: {c.provenance['episodes']} episodes a plant, level {c.provenance['difficulty']}",
        "",
        *columns([HEAD, *(plant_row(plant) for plant in c.plants)]),
        "",
        f"by technique, nominal: {techniques}",
        "",
        *columns([("check", "found", "must be", ""), *(check_row(check) for check in all_checks(c))]),
        *(f"note: {note}" for note in c.notes),
        "",
        verdict(c),
    ]
    return "\n".join(lines)


def verdict(certificate: Certificate) -> str:
    """Return whether a certificate is passed, and if not by what it failed, in one sentence."""
    failed = [check.name for check in all_checks(certificate) if not check.passed]
    if not failed:
        return f"PASS: {certificate.controller} meets all {len(all_checks(certificate))} thresholds."
    return f"FAIL: {certificate.controller} misses {', '.join(failed)}."


def plant_row(plant: PlantFigures) -> tuple[str, ...]:
    """Return the cells of a plant, as `HEAD`."""
    worst = next(iter(plant.failures.items()), ("-", 0))
    return (
        plant.name + (" (rollers)" if plant.physics == "rollers" else ""),
        share_text(plant.success),
        _change(plant.change),
        f"{worst[0]} {worst[1]}" if worst[1] else "-",
        _mean(plant.settling_s, "s"),
        _mean(plant.overshoot, ""),
        f"{plant.saturated_share.value:.0%}",
        _mean(plant.speed_error_m_s, "m/s"),
    )


def check_row(check: Check) -> tuple[str, ...]:
    """Return the cells of a check: name, what was found, limit, verdict."""
    return (
        check.name,
        check.text,
        f"{check.sense} {check.limit:g} {check.unit}".rstrip(),
        "ok" if check.passed else "MISSED",
    )


def all_checks(certificate: Certificate) -> tuple[Check, ...]:
    """Return all checks of a certificate, that of the time for a command last."""
    return (*certificate.checks, certificate.timing_check)


def timing_text(certificate: Certificate) -> str:
    """Return a certificate's times for a command in one sentence."""
    t = certificate.timing
    return (
        f"{t.commands} commands were timed. Of the processor's time half of them took up to "
        f"{milliseconds(t.p50_s)}, 99 of 100 up to {milliseconds(t.p99_s)}, the longest "
        f"{milliseconds(t.longest_s)}; the robot takes one every 100 ms."
    )


def columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of cells as lines of aligned columns."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return ["  ".join(f"{cell:{w}}" for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows]


def _change(change: Mean | None) -> str:
    if change is None:
        return "-"
    # Plus 0.0: no "-0.00".
    value, low, high = (round(x, 2) + 0.0 for x in (change.value, change.low, change.high))
    return f"{value:+.2f} ({low:+.2f} .. {high:+.2f})"


def _mean(found: Mean | None, unit: str) -> str:
    return "-" if found is None else f"{found.value:.2f}{' ' * bool(unit)}{unit}"
