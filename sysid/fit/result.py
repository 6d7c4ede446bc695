"""What a fit writes: `model.json` and `fit.json`."""

from __future__ import annotations

import datetime
import math
from dataclasses import asdict, replace
from typing import Any, Final

import numpy as np

import mecanum_env
from mecanum_env.law import WheelLaw
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.model import Model, Robot
from sysid.compare.own_error import with_own_error
from sysid.fit.metrics import finite_or_none
from sysid.fit.pipeline import Fit, latency, wheel_model
from sysid.fit.robot_stages import on_rollers
from sysid.fit.statistics import Quantity

FORMAT: Final = "mecanum-fit/1"


def fitted_model(fit: Fit, robot: Robot | None = None) -> Model:
    """Return the model of a fit.

    Args:
        fit: the fitted wheel.
        robot: what is known of the robot around it; what the fit was given when None.

    Returns:
        A model whose "uncertainty" holds the covariance of the coefficients and how far the model is off from
        its own logs (`sysid.compare.model_error`), and whose "command_latency" is
        the fitted delay where there is one.
    """
    found, path = fit.estimate, fit.path
    wheel = wheel_model(path, found)
    around = fit.options.robot if robot is None else robot
    if fit.robot is not None:
        wheel = replace(wheel, law=fit.robot.law)
        fitted: dict[str, Any] = {p.name: p.value for p in fit.robot.parameters if p.fitted}
        around = replace(around, **fitted)
    model = Model(
        wheel=wheel,
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
    if fit.dataset.level == "robot" and not fit.wheels:
        model, said = on_rollers(model, fit.dataset, list(_robot_errors(fit)))
        notes = [*model.provenance["notes"], said]
        model = replace(model, provenance={**model.provenance, "notes": notes})
    return with_own_error(model, fit.dataset)


def fit_json(fit: Fit) -> dict[str, Any]:
    """Return the object of `fit.json`; what is not finite or not known is null."""
    sure, tests = fit.uncertainty, fit.residual_tests
    return {
        "format": FORMAT,
        "dataset": fit.dataset.name,
        "method": fit.estimate.method,
        "methods": {name: figures.as_json() for name, figures in fit.methods.items()},
        "parameters": {q.name: _quantity(q) for q in sure.parameters},
        "functionals": {q.name: _quantity(q) for q in sure.functionals},
        "wheels": {wheel: _law(estimate.law) for wheel, estimate in fit.wheels.items()},
        "robot": _robot(fit),
        "noise": {
            "sigma_rpm": dict(fit.sigma_rpm),
            "source": "repeats" if fit.sigma_from_repeats else "residuals of the fit",
            "residual_over_sigma": finite_or_none(sure.noise_ratio),
        },
        "identifiability": {
            "condition_number": finite_or_none(sure.condition_number),
            "samples": sure.samples,
            "effective_samples": finite_or_none(sure.effective_samples),
            "warnings": list(sure.warnings),
        },
        "residual_tests": {
            "level": tests.level,
            "whiteness": {
                "passed": tests.whiteness.passed,
                "p_value": finite_or_none(tests.whiteness.p_value),
                "statistic": finite_or_none(tests.whiteness.statistic),
            },
            "input_correlation": {
                "passed": tests.input_correlation.passed,
                "p_value": finite_or_none(tests.input_correlation.p_value),
                "statistic": finite_or_none(tests.input_correlation.statistic),
            },
        },
        "command_path": {k: _plain(v) for k, v in asdict(fit.path).items() if k != "notes"},
        "notes": list(fit.notes),
        "findings": [asdict(finding) for finding in fit.dataset.findings],
        "provenance": {
            "version": mecanum_env.__version__,
            "data_sha256": fit.dataset.sha256,
            "seed": fit.options.seed,
        },
    }


def _robot(fit: Fit) -> dict[str, Any]:
    """Return what is known of the parameters that no ruler measures; empty for bench logs."""
    if fit.robot is None:
        return {}
    return {
        p.name: {
            "value": p.value,
            "standard_error": finite_or_none(p.standard_error),
            "fitted": p.fitted,
            "reason": p.reason,
        }
        for p in fit.robot.parameters
    }


def _robot_errors(fit: Fit) -> dict[str, float]:
    """Return the standard errors of the robot's fitted parameters, where there are any."""
    parameters = fit.robot.parameters if fit.robot else ()
    return {p.name: p.standard_error for p in parameters if p.fitted and math.isfinite(p.standard_error)}


def _covariance(fit: Fit) -> dict[str, Any]:
    """Return names and covariance of A-F; without the matrix where the data leave a coefficient unknown."""
    covariance = np.asarray(fit.uncertainty.covariance)[:6, :6]
    if fit.robot is not None:
        covariance = fit.robot.covariance
    known = bool(np.all(np.isfinite(covariance)))
    return {
        "names": list(COEFFICIENTS),
        "covariance": covariance.tolist() if known else None,
        "degrees_of_freedom": finite_or_none(fit.uncertainty.degrees_of_freedom),
    }


def _quantity(q: Quantity) -> dict[str, Any]:
    return {
        "value": finite_or_none(q.value),
        "unit": q.unit,
        "standard_error": finite_or_none(q.standard_error),
        "cramer_rao_bound": finite_or_none(q.cramer_rao),
        "low": finite_or_none(q.low),
        "high": finite_or_none(q.high),
    }


def _law(law: WheelLaw) -> dict[str, float]:
    return {
        **dict(zip(COEFFICIENTS, law.coefficients.tolist(), strict=True)),
        "sample_period_s": law.sample_period_s,
    }


def _plain(value: Any) -> Any:
    return finite_or_none(value) if isinstance(value, float) else value
