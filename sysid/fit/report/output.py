"""The results of a fit as files: `model.json` and `fit.json`."""

from __future__ import annotations

import datetime
import math
from dataclasses import asdict, replace
from typing import Any, Final

import numpy as np

import mecanum_env
from mecanum_env.files import plain_json
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.model import Model, Robot
from sysid.compare.links import AlignedLogs
from sysid.compare.model_error import with_own_error
from sysid.fit.drive import latency, wheel_model
from sysid.fit.pipeline import Fit
from sysid.fit.report.stated import stated_json
from sysid.fit.robot import on_rollers
from sysid.fit.statistics import Quantity

FORMAT: Final = "mecanum-fit/1"


def fitted_model(fit: Fit, robot: Robot | None = None) -> Model:
    """Return the model of a fit.

    Its `uncertainty` holds the covariance of the coefficients, that of coefficients and effects together
    where effects were fitted (`joint`), and the model's own error on the logs (`sysid.compare.model_error`).
    Its effect "command_latency" is the fitted delay, if there is one. The `robot` around the wheel is by
    default the one that the fit was given.
    """
    found, path = fit.estimate, fit.path
    around = fit.options.robot if robot is None else robot
    if fit.robot is not None:
        fitted: dict[str, Any] = {p.name: p.value for p in fit.robot.parameters if p.fitted}
        around = replace(around, **fitted, servo_windup=fit.robot.robot.servo_windup)
    model = Model(
        wheel=wheel_model(path, found),
        wheels={wheel: estimate.law for wheel, estimate in fit.wheels.items()},
        robot=around,
        effects=latency(found),
        uncertainty={"wheel": _covariance(fit), "robot": _robot_errors(fit)},
        provenance={
            "program": f"python -m sysid.fit, mecanum-tankendo {mecanum_env.__version__}",
            "date": datetime.date.today().isoformat(),
            "method": found.method,
            "dataset": fit.dataset.name,
            "data_sha256": fit.dataset.sha256,
            "seed": fit.options.seed,
            "notes": list(fit.notes),
        },
    )
    if fit.drive_effects is not None:
        together = fit.drive_effects.model
        stated = {**model.uncertainty, **{key: together.uncertainty[key] for key in ("effects", "joint")}}
        stated["wheel"] = {**stated["wheel"], **together.uncertainty["wheel"]}
        model = replace(model, wheel=together.wheel, effects=together.effects, uncertainty=stated)
    if fit.robot is not None:
        model = replace(model, wheel=replace(model.wheel, law=fit.robot.law))
    if fit.dataset.level == "robot" and not fit.wheels:
        model, note = on_rollers(model, fit.dataset, list(_robot_errors(fit)))
        notes = [*model.provenance["notes"], note]
        model = replace(model, provenance={**model.provenance, "notes": notes})
    if fit.link is None:
        return with_own_error(model, fit.dataset)
    described = fit.link.as_fitted(model)
    aligned = AlignedLogs.stated(fit.link.logs, described) or fit.link
    own = with_own_error(aligned.model, aligned.dataset)
    return replace(described, uncertainty={**own.uncertainty, **described.uncertainty})


def fit_json(fit: Fit, model: Model | None = None) -> dict[str, Any]:
    """Return the object of `fit.json`; numbers that are not finite or not known are null.

    Its field `model` is of the `model` that was written beside it, by default that of `fitted_model`.
    """
    sure, tests = fit.uncertainty, fit.residual_tests
    robot = fit.robot.parameters if fit.robot else ()
    content: dict[str, Any] = plain_json(
        {
            "format": FORMAT,
            "dataset": fit.dataset.name,
            "method": fit.estimate.method,
            "methods": {name: metrics.as_json() for name, metrics in fit.methods.items()},
            "parameters": {q.name: _quantity(q) for q in sure.parameters},
            "functionals": {q.name: _quantity(q) for q in sure.metrics},
            "drive_effects": _drive_effects(fit),
            "model": stated_json(fit, fitted_model(fit) if model is None else model),
            "wheels": {wheel: estimate.law for wheel, estimate in fit.wheels.items()},
            "robot": {p.name: {k: v for k, v in asdict(p).items() if k != "name"} for p in robot},
            "noise": {
                "sigma_rpm": fit.sigma_rpm,
                "source": "repeats" if fit.sigma_from_repeats else "residuals of the fit",
                "residual_over_sigma": sure.noise_ratio,
            },
            "identifiability": {
                "condition_number": sure.condition_number,
                "samples": sure.samples,
                "effective_samples": sure.effective_samples,
                "warnings": sure.warnings,
            },
            "residual_tests": {
                "level": tests.whiteness.level,
                **{
                    name: {"passed": test.passed, "p_value": test.p_value, "statistic": test.statistic}
                    for name, test in vars(tests).items()
                },
            },
            "command_path": {name: value for name, value in asdict(fit.path).items() if name != "notes"},
            "notes": fit.notes,
            "findings": [finding.to_json() for finding in fit.dataset.findings],
            "provenance": {
                "version": mecanum_env.__version__,
                "data_sha256": fit.dataset.sha256,
                "seed": fit.options.seed,
            },
        }
    )
    return content


def _drive_effects(fit: Fit) -> dict[str, Any] | None:
    """Return what the drive does besides its law, with the held-out error without and with it [rpm]."""
    found = fit.drive_effects
    if found is None:
        return None
    values = {name: dict(parameters) for name, parameters in found.model.effects.items()}
    return {"effects": values, "before_rpm": found.before_rpm, "after_rpm": found.after_rpm}


def _robot_errors(fit: Fit) -> dict[str, float]:
    """Return the standard errors of the robot's fitted parameters that have one."""
    parameters = fit.robot.parameters if fit.robot else ()
    return {p.name: p.standard_error for p in parameters if p.fitted and math.isfinite(p.standard_error)}


def _covariance(fit: Fit) -> dict[str, Any]:
    """Return the names and the covariance of A-F; no matrix if the logs do not determine a coefficient."""
    covariance = fit.robot.covariance if fit.robot else np.asarray(fit.uncertainty.covariance)[:6, :6]
    known = bool(np.all(np.isfinite(covariance)))
    return {
        "names": list(COEFFICIENTS),
        "covariance": covariance.tolist() if known else None,
        "degrees_of_freedom": plain_json(fit.uncertainty.degrees_of_freedom),
    }


def _quantity(q: Quantity) -> dict[str, Any]:
    return {
        "value": q.value,
        "unit": q.unit,
        "standard_error": q.standard_error,
        "cramer_rao_bound": q.cramer_rao,
        "low": q.low,
        "high": q.high,
    }
