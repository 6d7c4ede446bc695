"""The page of a fit."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

import mecanum_env
from mecanum_env.law.metrics import step_response
from mecanum_env.model import Model
from mecanum_env.report import figure, report_available, write_page
from sysid.fit.pipeline import Fit
from sysid.fit.plots import BenchReplay, RunView, replay_worst, run_views
from sysid.fit.table import method_table, quantity_table, robot_table
from sysid.logs import Split

_TEMPLATE: Final = Path(__file__).with_name("page.html")
_GREY, _RED, _BLUE = "#8a8a8a", "#c8102e", "#1f4e79"
_MOST_FINDINGS: Final = 40
_HELD_OUT_FIRST: Final[tuple[Split, ...]] = ("test", "validation", "fit")


def write_fit_report(fit: Fit, model: Model, path: Path) -> bool:
    """Write the page of a fit; return False, writing nothing, where the `report` extra is not installed.

    Args:
        fit: the fitted wheel.
        model: what was written to model.json; it is replayed in MuJoCo beside the law.
        path: of the page.
    """
    if not report_available():
        return False
    views = run_views(fit, most=6)
    overlays = {f"run{i}": _overlay(view) for i, view in enumerate(views)}
    tests = fit.residual_tests
    findings = fit.dataset.findings[:_MOST_FINDINGS]
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
        verdict=_verdict(fit),
        warnings=list(fit.uncertainty.warnings),
        notes=list(fit.notes),
        overlays=list(overlays),
        methods=method_table(fit),
        quantities=quantity_table(fit),
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
        findings=findings,
        provenance=f"mecanum-tankendo {mecanum_env.__version__}, seed {fit.options.seed}, "
        f"data sha256 {fit.dataset.sha256[:16]}",
    )
    return True


def _verdict(fit: Fit) -> str:
    found = fit.methods[fit.estimate.method]
    split = next(split for split in _HELD_OUT_FIRST if split in found.errors)
    error, sigma = found.errors[split], float(np.mean(list(fit.sigma_rpm.values())))
    free = fit.estimate.free
    order = ("first", "second", "third")[("B" in free) + ("C" in free)]
    against = (
        f"against {sigma:.2f} rpm of noise" if fit.sigma_from_repeats else "with no repeats to tell the noise"
    )
    return (
        f"A stable {order}-order law predicts the {split} runs to {error.rms_rpm:.2f} rpm rms, {against}; "
        f"it rises in {found.metrics.rise_time_s:.3f} s and settles in {found.metrics.settling_time_s:.3f} s."
    )


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


def _overlay(view: RunView) -> dict[str, Any]:
    return figure(
        [
            _line(
                view.time_s,
                view.measured_rpm,
                "measured",
                _GREY,
                mode="markers",
                marker={"size": 3, "color": _GREY},
            ),
            _line(
                view.tick_s,
                view.command_rpm,
                "command",
                _BLUE,
                line={"color": _BLUE, "width": 1, "shape": "hv"},
            ),
            _line(view.tick_s, view.simulated_rpm, "simulated", _RED),
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
    return figure(
        [
            _line(np.cos(turn), np.sin(turn), "unit circle", _GREY, hoverinfo="skip"),
            _line(
                poles.real,
                poles.imag,
                "poles",
                _RED,
                mode="markers",
                marker={"symbol": "x", "size": 10, "color": _RED},
            ),
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
