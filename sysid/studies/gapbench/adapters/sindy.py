"""PySINDy on the simulator's error: its sparse differential equation, and a table from terms to names.

The derivative of the error is written as a sparse sum of terms of command, simulated speed, time and angle,
each scaled to unit size. The largest term beside the error's own decay names the effect.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import pysindy

from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.logs import Run
from sysid.studies.gapbench.adapters.fitting import Logs
from sysid.studies.gapbench.adapters.residuals import has_changed
from sysid.studies.gapbench.case_folder import CHANNEL, simulated
from sysid.studies.gapbench.cases import Answer, BenchCase

_TERMS: Final = (
    ("command", (("speed_gain",), ("sensor_scale",), ("viscous_friction",))),
    ("size of the command", (("direction_asymmetry",),)),
    ("command times time", (("battery_sag",),)),
    ("command times exp(-time)", (("warm_up",),)),
    ("command above two thirds of the largest", (("speed_saturation",),)),
    ("command below a sixth of the largest", (("command_deadband",),)),
    ("sign of the speed", (("coulomb_friction",),)),
    ("sign of a slow speed", (("stiction",),)),
    ("last change of the command", (("command_latency",), ("sensor_latency",))),
    ("acceleration", (("load_inertia",), ("sensor_lowpass",))),
    ("sign of a large acceleration", (("acceleration_limit",),)),
    ("sign of the speed after a reversal", (("backlash",),)),
    ("sine of the angle", (("torque_ripple",), ("encoder_eccentricity",))),
    ("cosine of the angle", (("torque_ripple",), ("encoder_eccentricity",))),
)
"""Term of the library -> what it stands for, as candidates."""
_THRESHOLDS: Final = (0.4, 0.2, 0.1, 0.05, 0.02)
"""Of the sparse regression, the sparsest first."""
_WORTH: Final = 0.02
"""Share of the derivative's variance that the next smaller threshold must explain beyond the last."""
_LEAST: Final = 0.1
"""Share of the variance below which nothing is explained."""
_RECENT_S: Final = 0.15


def answer(case: BenchCase) -> Answer:
    """Return what the largest term of the error's equation stands for."""
    if not has_changed(case):
        return Answer("no_gap")
    runs = Logs(case.changed.runs).chosen
    step_s = float(np.median(np.concatenate([np.diff(run.time_s) for run in runs])))
    top = max(float(np.max(np.abs(run.command.wheels_rpm))) for run in runs)
    errors, terms = [], []
    for run in runs:
        clock = np.arange(0.0, run.duration_s, step_s)
        said = simulated(case.model, run, known=True)
        known = np.isfinite(run.channels[CHANNEL])
        error = np.interp(clock, run.time_s[known], (run.channels[CHANNEL] - said)[known])
        errors.append(error[:, None])
        terms.append(_terms(run, said, clock, top))
    error_rms = max(float(np.sqrt(np.mean(np.concatenate(errors) ** 2))), 1e-9)
    scale = np.maximum(np.sqrt(np.mean(np.concatenate(terms) ** 2, axis=0)), 1e-9)
    scaled = [error / error_rms for error in errors]
    found, explained = _sparse(scaled, [term / scale for term in terms], step_s)
    coefficients = found.coefficients()[0]
    predictions = tuple(
        error_rms * _integrated(case, run, coefficients, top, scale, step_s) for run in case.test
    )
    largest = int(np.argmax(np.abs(coefficients[1:])))
    if explained < _LEAST or coefficients[1 + largest] == 0.0:
        return Answer("unexplained", predictions=_added(case, predictions))
    names = _TERMS[largest][1]
    if len(names) > 1:
        return Answer("ambiguous", candidates=names, predictions=_added(case, predictions))
    return Answer("named", {names[0][0]: {}}, predictions=_added(case, predictions))


def _sparse(errors: Sequence[FloatArray], terms: Sequence[FloatArray], step_s: float) -> tuple[Any, float]:
    """Return the sparsest model that explains almost as much as a less sparse one, and its share."""
    kept: tuple[Any, float] | None = None
    for threshold in _THRESHOLDS:
        model = pysindy.SINDy(
            optimizer=pysindy.STLSQ(threshold=threshold, alpha=0.01),
            feature_library=pysindy.IdentityLibrary(),
            differentiation_method=pysindy.SmoothedFiniteDifference(),
        )
        with warnings.catch_warnings():
            # A threshold that leaves no term, and a window longer than a run, are no trouble here.
            warnings.simplefilter("ignore")
            model.fit(list(errors), t=step_s, u=list(terms))
            share = float(model.score(list(errors), t=step_s, u=list(terms)))
        if kept is None or share > kept[1] + _WORTH:
            kept = model, share
    assert kept is not None
    return kept


def _terms(run: Run, said_rpm: FloatArray, clock: FloatArray, top_rpm: float) -> FloatArray:
    """Return the library's terms at times of a run, shape (m, terms).

    Args:
        run: with its commands.
        said_rpm: simulated speed at the run's rows, shape (n,).
        clock: evenly spaced times [s], shape (m,).
        top_rpm: largest command.
    """
    rows = np.searchsorted(run.time_s, clock, side="right") - 1
    before = np.maximum(np.searchsorted(run.time_s, clock - _RECENT_S, side="right") - 1, 0)
    command = run.command.wheels_rpm[:, 0]
    now, earlier = command[rows] / top_rpm, command[before] / top_rpm
    speed = np.interp(clock, run.time_s, said_rpm) / top_rpm
    faster = np.gradient(speed, clock)
    angle = np.cumsum(speed) * top_rpm * RAD_S_PER_RPM * float(clock[1] - clock[0])
    sign = np.tanh(speed / 0.02)
    turned = np.sign(now) * np.sign(earlier) < 0.0
    columns = (
        now,
        np.abs(now),
        now * clock,
        now * np.exp(-clock),
        np.sign(now) * np.maximum(np.abs(now) - 2.0 / 3.0, 0.0),
        np.where(np.abs(now) < 1.0 / 6.0, now, 0.0),
        sign,
        sign * np.exp(-np.abs(speed) / 0.05),
        now - earlier,
        faster,
        np.tanh(faster / 2.0),
        np.where(turned, sign, 0.0),
        np.sin(angle) * speed,
        np.cos(angle) * speed,
    )
    return np.stack(columns, axis=1)


def _integrated(
    case: BenchCase, run: Run, coefficients: FloatArray, top_rpm: float, scale: FloatArray, step_s: float
) -> FloatArray:
    """Return the error that the equation predicts at the rows of a run, shape (n,), in units of its rms.

    Args:
        case: with the simulator.
        run: without measurements.
        coefficients: of the error itself and of each term, shape (1 + terms,).
        top_rpm: largest command of the changed logs.
        scale: of each term, shape (terms,).
        step_s: of the integration [s].
    """
    clock = np.arange(0.0, run.duration_s + step_s, step_s)
    terms = _terms(run, simulated(case.model, run, known=False), clock, top_rpm) / scale
    # An error that grows by itself was measured in noise; it is held instead.
    decay = float(np.exp(min(coefficients[0], 0.0) * step_s))
    forced = terms @ coefficients[1:] * step_s
    error = np.zeros(clock.size)
    for i in range(1, clock.size):
        error[i] = decay * error[i - 1] + forced[i - 1]
    return np.interp(run.time_s, clock, error)


def _added(case: BenchCase, errors: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
    """Return the simulated speeds of the hidden test runs with their predicted errors, each (n,)."""
    return tuple(
        simulated(case.model, run, known=False) + error for run, error in zip(case.test, errors, strict=True)
    )
