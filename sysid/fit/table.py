"""The terminal's view of a fit."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sysid.fit.metrics import MethodMetrics
from sysid.fit.pipeline import Fit
from sysid.fit.statistics import Quantity


def fit_table(fit: Fit) -> str:
    """Return what a fit found in a screenful: methods, coefficients, what is well determined, and notes."""
    sure, tests = fit.uncertainty, fit.residual_tests
    source = "from repeats" if fit.sigma_from_repeats else "from the residuals, no repeats"
    noise = ", ".join(f"{name} {value:.3g}" for name, value in sorted(fit.sigma_rpm.items()))
    lines = [
        f"{fit.dataset.name}: {len(fit.dataset.runs)} runs; noise {noise} rpm ({source})",
        "",
        *_columns(method_table(fit)),
        "",
        *_columns(quantity_table(fit)),
        "",
        *([*_columns(robot_table(fit)), ""] if fit.robot else []),
        f"residuals: {_verdict('white', tests.whiteness.passed, tests.whiteness.p_value)}; "
        f"{_verdict('free of the input', tests.input_correlation.passed, tests.input_correlation.p_value)}; "
        f"{sure.noise_ratio:.2f} times the noise",
    ]
    lines += [f"warning: {warning}" for warning in sure.warnings]
    lines += [f"note: {note}" for note in fit.notes]
    kinds = sorted({finding.kind for finding in fit.dataset.findings})
    if kinds:
        lines.append(f"in the logs: {', '.join(kinds)} (python -m sysid.logs check LOGS says more)")
    return "\n".join(lines)


def method_table(fit: Fit) -> list[tuple[str, ...]]:
    """Return the methods' figures as rows of cells, the head first."""
    return [_METHOD_HEAD, *(_method_row(name, figures) for name, figures in fit.methods.items())]


def quantity_table(fit: Fit) -> list[tuple[str, ...]]:
    """Return coefficients and what they mean as rows of cells, the head first."""
    return [
        _QUANTITY_HEAD,
        *(_quantity_row(q) for q in (*fit.uncertainty.parameters, *fit.uncertainty.functionals)),
    ]


def robot_table(fit: Fit) -> list[tuple[str, ...]]:
    """Return what robot logs say of the robot as rows of cells, the head first, alone for bench logs."""
    parameters = fit.robot.parameters if fit.robot else ()
    return [
        ("robot", "value", "standard error", ""),
        *(
            (
                p.name,
                f"{p.value:.4g}",
                f"{p.standard_error:.2g}" if p.fitted and math.isfinite(p.standard_error) else "-",
                p.reason,
            )
            for p in parameters
        ),
    ]


_METHOD_HEAD = ("method", "rms fit", "validation", "test rpm", "worst", "rise s", "settling s", "dc gain - 1",
                "stable", "starts ok", "seconds", "MiB")  # fmt: skip
_QUANTITY_HEAD = ("", "value", "standard error", "Cramer-Rao", "95 % interval")


def _method_row(name: str, m: MethodMetrics) -> tuple[str, ...]:
    found = m.estimate
    errors = [m.errors.get(split) for split in ("fit", "validation", "test")]
    worst = max((e.max_rpm for e in errors if e), default=math.nan)
    return (
        name,
        *(f"{e.rms_rpm:.3f}" if e else "-" for e in errors),
        f"{worst:.2f}",
        f"{m.metrics.rise_time_s:.4f}",
        f"{m.metrics.settling_time_s:.4f}",
        f"{found.law.dc_gain - 1.0:.1e}",
        "yes" if found.law.is_stable else "NO",
        f"{found.success_share:.0%} of {len(found.starts)}",
        f"{found.seconds:.2f}",
        f"{m.peak_memory_mib:.1f}",
    )


def _quantity_row(q: Quantity) -> tuple[str, ...]:
    unit = f" {q.unit}" if q.unit else ""
    return (
        q.name,
        f"{q.value:.5g}{unit}",
        f"{q.standard_error:.2g}",
        f"{q.cramer_rao:.2g}",
        f"{q.low:.5g} .. {q.high:.5g}",
    )


def _verdict(what: str, passed: bool, p_value: float) -> str:
    return f"{'' if passed else 'not '}{what} (p = {p_value:.2g})"


def _columns(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return [
        "  ".join(
            cell.ljust(w) if i == 0 else cell.rjust(w)
            for i, (cell, w) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]
