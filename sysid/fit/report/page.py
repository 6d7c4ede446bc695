"""The report of a fit: the table in the terminal and the page `report.html`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

import mecanum_env
from mecanum_env.law import WheelLaw
from mecanum_env.law.metrics import StepMetrics, law_step_metrics, step_response
from mecanum_env.model import Model
from mecanum_env.report import figure, write_page
from mecanum_env.units import FloatArray
from sysid.fit.pipeline import Fit
from sysid.fit.report.plots import HELD_OUT_FIRST, BenchReplay, RunView, replay_worst, run_views
from sysid.fit.report.stated import errors_of, has_more_than_its_law, speeds_with_effects
from sysid.fit.statistics import ErrorMetrics
from sysid.logs.runs import Split

_TEMPLATE: Final = Path(__file__).with_name("page.html")
_GREY, _RED, _BLUE, _GREEN = "#8a8a8a", "#c8102e", "#1f4e79", "#2a8c3c"
_MOST_FINDINGS: Final = 40


def fit_table(fit: Fit, model: Model | None = None) -> str:
    """Return the result of a `fit` as text: noise, methods, coefficients, residual tests and notes.

    With its `model` there is a row of that, too, where law and effects were fitted together.
    """
    sure, tests = fit.uncertainty, fit.residual_tests
    source = "from repeats" if fit.sigma_from_repeats else "from the residuals, no repeats"
    noise = ", ".join(f"{name} {value:.3g}" for name, value in sorted(fit.sigma_rpm.items()))
    lines = [
        f"{fit.dataset.name}: {len(fit.dataset.runs)} runs; noise {noise} rpm ({source})",
        "",
        *_columns(_method_table(fit, model)),
        "",
        *_columns(_quantity_table(fit)),
        "",
        *([*_columns(robot_table(fit)), ""] if fit.robot else []),
        f"residuals: {_passed('white', tests.whiteness.passed, tests.whiteness.p_value)}; "
        f"{_passed('free of the input', tests.input_correlation.passed, tests.input_correlation.p_value)}; "
        f"{sure.noise_ratio:.2f} times the noise",
    ]
    lines += [f"warning: {warning}" for warning in sure.warnings]
    lines += [f"note: {note}" for note in fit.notes]
    kinds = sorted({finding.kind for finding in fit.dataset.findings})
    if kinds:
        lines.append(f"in the logs: {', '.join(kinds)} (python -m sysid.logs check LOGS says more)")
    return "\n".join(lines)


def _method_table(fit: Fit, model: Model | None) -> list[tuple[str, ...]]:
    """Return the metrics of a `fit`'s methods and of its model with effects as rows, the head first."""
    rows: list[tuple[str, ...]] = [
        ("method", "rms fit", "validation", "test rpm", "worst", "rise s", "settling s", "dc gain - 1",
         "stable", "starts ok", "seconds", "MiB")
    ]  # fmt: skip
    for name, m in fit.methods.items():
        found = m.estimate
        row = (
            *_law_cells(name, m.errors, found.law, m.metrics),
            f"{found.success_share:.0%} of {len(found.starts)}",
            f"{found.seconds:.2f}",
            f"{m.peak_memory_mib:.1f}",
        )
        rows.append(row)
    if model is not None and has_more_than_its_law(fit):
        law = model.wheel.law
        cells = _law_cells("with effects", errors_of(fit, model), law, law_step_metrics(law))
        rows.append((*cells, "-", "-", "-"))
    return rows


def _law_cells(
    name: str, errors: Mapping[Split, ErrorMetrics], law: WheelLaw, step: StepMetrics
) -> tuple[str, ...]:
    """Return the cells of a row that are of the model itself: its errors, and those of its law."""
    of_splits = [errors.get(split) for split in ("fit", "validation", "test")]
    return (
        name,
        *(f"{e.rms_rpm:.3f}" if e else "-" for e in of_splits),
        f"{max((e.max_rpm for e in of_splits if e), default=math.nan):.2f}",
        f"{step.rise_time_s:.4f}",
        f"{step.settling_time_s:.4f}",
        f"{law.dc_gain - 1.0:.1e}",
        "yes" if law.is_stable else "NO",
    )


def _quantity_table(fit: Fit) -> list[tuple[str, str, str, str, str]]:
    """Return the coefficients of a `fit` and what follows from them as rows of cells, the head first."""
    rows = [("", "value", "standard error", "Cramer-Rao", "95 % interval")]
    for q in (*fit.uncertainty.parameters, *fit.uncertainty.metrics):
        value = f"{q.value:.5g}{' ' + q.unit if q.unit else ''}"
        errors = f"{q.standard_error:.2g}", f"{q.cramer_rao:.2g}"
        rows.append((q.name, value, *errors, f"{q.low:.5g} .. {q.high:.5g}"))
    return rows


def robot_table(fit: Fit) -> list[tuple[str, ...]]:
    """Return the robot's parameters of a `fit` as rows of cells, the head first; none for bench logs."""
    rows: list[tuple[str, ...]] = [("robot", "value", "standard error", "")]
    for p in fit.robot.parameters if fit.robot else ():
        error = f"{p.standard_error:.2g}" if p.fitted and math.isfinite(p.standard_error) else "-"
        rows.append((p.name, f"{p.value:.4g}", error, p.reason))
    return rows


def _passed(what: str, passed: bool, p_value: float) -> str:
    return f"{'' if passed else 'not '}{what} (p = {p_value:.2g})"


def _columns(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    cells = [[cell.rjust(width) for cell, width in zip(row, widths, strict=True)] for row in rows]
    return ["  ".join([row[0].ljust(widths[0]), *right[1:]]) for row, right in zip(rows, cells, strict=True)]


def write_fit_report(fit: Fit, model: Model, path: Path) -> None:
    """Write the page of a fit, whose model is replayed."""
    views = run_views(fit, most=6)
    together = speeds_with_effects(fit, model)
    overlays = {f"run{i}": _overlay(view, together.get(view.name)) for i, view in enumerate(views)}
    tests = fit.residual_tests
    write_page(
        path,
        _TEMPLATE,
        {
            **overlays,
            "poles": _poles(fit),
            "step": _step(fit),
            "residuals": _residuals(fit, views),
            "autocorrelation": _autocorrelation(fit),
        },
        dataset=fit.dataset.name,
        verdict=_verdict(fit, model),
        warnings=list(fit.uncertainty.warnings),
        notes=list(fit.notes),
        overlays=list(overlays),
        has_effects=bool(together),
        methods=_method_table(fit, model),
        quantities=_quantity_table(fit),
        robot=robot_table(fit),
        period_ms=f"{fit.law.sample_period_s * 1e3:.4g}",
        noise_source="repeats" if fit.sigma_from_repeats else "the residuals too, as there are no repeats",
        residual_verdict=(
            f"The residual is {fit.uncertainty.noise_ratio:.2f} times the noise. "
            + ("It is white" if tests.whiteness.passed else "It is not white: something is left to explain")
            + f" (Ljung-Box p = {tests.whiteness.p_value:.2g}). "
            + (
                "It shows no trace of the command"
                if tests.input_correlation.passed
                else "It follows the command: the law itself falls short"
            )
            + f" (F test p = {tests.input_correlation.p_value:.2g})."
        ),
        mujoco=_mujoco(replay_worst(fit, model)),
        findings=fit.dataset.findings[:_MOST_FINDINGS],
        provenance=f"mecanum-tankendo {mecanum_env.__version__}, seed {fit.options.seed}, "
        f"data sha256 {fit.dataset.sha256[:16]}",
    )


def _verdict(fit: Fit, model: Model) -> str:
    found = fit.methods[fit.estimate.method]
    split = next(split for split in HELD_OUT_FIRST if split in found.errors)
    error, sigma = found.errors[split], float(np.mean(list(fit.sigma_rpm.values())))
    order = ("first", "second", "third")[("B" in fit.estimate.free) + ("C" in fit.estimate.free)]
    against = (
        f"against {sigma:.2f} rpm of noise" if fit.sigma_from_repeats else "with no repeats to tell the noise"
    )
    of_law = (
        f"A stable {order}-order law predicts the {split} runs to {error.rms_rpm:.2f} rpm rms, {against}; "
        f"it rises in {found.metrics.rise_time_s:.3f} s and settles in {found.metrics.settling_time_s:.3f} s."
    )
    together = errors_of(fit, model).get(split) if has_more_than_its_law(fit) else None
    if together is None:
        return of_law
    return f"{of_law} With the effects that were fitted together, it is {together.rms_rpm:.2f} rpm."


def _mujoco(replay: BenchReplay | None) -> str:
    if replay is None:
        return "Robot logs: replay the model with python -m mecanum_env.render."
    return (
        f"Run {replay.name} replayed on the one-wheel bench: {replay.measured_rms_rpm:.3f} rpm rms "
        f"against the measurement in MuJoCo, {replay.law_measured_rms_rpm:.3f} by the law alone. "
        f"The servo that holds the law's speed adds {replay.servo_rms_rpm:.3f} rpm rms "
        f"(at most {replay.servo_max_rpm:.3f})."
    )


def _line(x: Any, y: Any, name: str, colour: str, **more: Any) -> dict[str, Any]:
    style = {"type": "scatter", "mode": "lines", "line": {"color": colour, "width": 1.6}}
    return {**style, "x": np.asarray(x).tolist(), "y": np.asarray(y).tolist(), "name": name, **more}


def _overlay(view: RunView, together: tuple[FloatArray, FloatArray] | None) -> dict[str, Any]:
    dots = {"mode": "markers", "marker": {"size": 3, "color": _GREY}}
    steps = {"line": {"color": _BLUE, "width": 1, "shape": "hv"}}
    return figure(
        [
            _line(view.time_s, view.measured_rpm, "measured", _GREY, **dots),
            _line(view.tick_s, view.command_rpm, "command", _BLUE, **steps),
            _line(view.tick_s, view.simulated_rpm, "simulated" if together is None else "law alone", _RED),
            *([] if together is None else [_line(*together, "with effects", _GREEN)]),
        ],
        title=f"{view.name} ({view.split}), rms {view.rms_rpm:.2f} rpm",
        x="time [s]",
        y="rpm",
    )


def _residuals(fit: Fit, views: list[RunView]) -> dict[str, Any]:
    sigma = float(np.mean(list(fit.sigma_rpm.values())))
    band = [
        {"type": "rect", "xref": "paper", "x0": 0, "x1": 1, "y0": -2 * sigma, "y1": 2 * sigma,
         "fillcolor": "#000", "opacity": 0.07, "line": {"width": 0}}
    ]  # fmt: skip
    traces = [
        {"type": "scatter", "mode": "lines", "line": {"width": 1}, "x": v.time_s.tolist(),
         "y": v.residual_rpm.tolist(), "name": f"{v.name} ({v.split})"}
        for v in views
    ]  # fmt: skip
    return figure(
        traces,
        title="measured minus simulated; band: noise, 2 sigma",
        x="time [s]",
        y="rpm",
        layout={"shapes": band, "showlegend": False},
    )


def _autocorrelation(fit: Fit) -> dict[str, Any]:
    test = fit.residual_tests.whiteness
    lags = list(range(1, len(test.correlation) + 1))
    bound = [
        {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": sign * test.bound, "y1": sign * test.bound,
         "line": {"color": _BLUE, "dash": "dot", "width": 1}}
        for sign in (-1, 1)
    ]  # fmt: skip
    return figure(
        [{"type": "bar", "x": lags, "y": test.correlation.tolist(), "marker": {"color": _GREY}}],
        title="autocorrelation of the residual",
        x="lag [samples]",
        layout={"shapes": bound},
    )


def _poles(fit: Fit) -> dict[str, Any]:
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    poles = fit.law.poles
    crosses = {"mode": "markers", "marker": {"symbol": "x", "size": 10, "color": _RED}}
    return figure(
        [
            _line(np.cos(turn), np.sin(turn), "unit circle", _GREY, hoverinfo="skip"),
            _line(poles.real, poles.imag, "poles", _RED, **crosses),
        ],
        title="poles: |z| = " + ", ".join(f"{abs(p):.3f}" for p in poles),
        height=400,
        layout={"yaxis": {"scaleanchor": "x", "zeroline": False}},
    )


def _step(fit: Fit) -> dict[str, Any]:
    ticks = max(30, int(np.ceil(0.6 / fit.law.sample_period_s)))
    response = step_response(fit.law, ticks)
    time = np.arange(len(response)) * fit.law.sample_period_s
    return figure(
        [_line(time, response, "law", _RED)], title="response to a unit step", x="time [s]", height=400
    )
