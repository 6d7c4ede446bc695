"""What `model.json` states where it is more than the law of the fit: its own law, effects and errors.

The other figures of a fit are those of the law alone, which is what methods compare and what standard errors
describe. Law and effects that are fitted together have another law, and the model errs by far less.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any, Final

import numpy as np

from mecanum_env.effects.friction import droop_rpm, torques_of
from mecanum_env.errors import MecanumError
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.law.metrics import law_step_metrics
from mecanum_env.model import Model, cause_of, model_to_dict
from mecanum_env.statistics import rms
from mecanum_env.units import FloatArray
from sysid.compare.predicted import predict_all
from sysid.fit.pipeline import Fit
from sysid.fit.statistics import ErrorMetrics
from sysid.logs.runs import SPLITS, Split

_SPEED: Final = "speed_rpm"


def has_more_than_its_law(fit: Fit) -> bool:
    """Return whether law and effects of a drive on the bench were fitted together."""
    return fit.drive_effects is not None and fit.dataset.level == "bench"


def speeds_of(fit: Fit, model: Model) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return the times [s] and simulated speeds [rpm] of a model in each run of the bench logs of a fit.

    Commands are taken as logged, also where the fit found the time of each. Splits in which the model cannot
    be simulated are left out: held-out commands may drive a model astray that those of the fit do not.
    """
    found = {}
    for split in SPLITS:
        runs = fit.dataset.split(split)
        with suppress(MecanumError):
            for run, predicted in zip(runs, predict_all(model, runs) if runs else (), strict=True):
                found[run.file] = run.time_s, predicted[_SPEED]
    return found


def speeds_with_effects(fit: Fit, model: Model) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return what `speeds_of` does where law and effects were fitted together, else nothing."""
    return speeds_of(fit, model) if has_more_than_its_law(fit) else {}


def errors_of(fit: Fit, model: Model) -> dict[Split, ErrorMetrics]:
    """Return measured minus simulated speed, as `speeds_of` has it, on each split of bench logs."""
    speeds, found = speeds_of(fit, model), dict[Split, ErrorMetrics]()
    for split in SPLITS:
        runs = [run for run in fit.dataset.split(split) if run.file in speeds]
        if runs:
            parts = [(run.channel(_SPEED) - speeds[run.file][1])[run.finite(_SPEED)] for run in runs]
            error = np.concatenate(parts)
            found[split] = ErrorMetrics(rms(error), float(np.max(np.abs(error))), error.size, len(runs))
    return found


def stated_json(fit: Fit, model: Model) -> dict[str, Any]:
    """Return the field `model` of fit.json: the law of `model.json`, its effects, on the bench its errors.

    A torque is also told as the speed that it takes from a drive without integral action (`droop_rpm`).
    """
    law, step = model.wheel.law, law_step_metrics(model.wheel.law)
    robot = [p.name for p in fit.robot.parameters if p.fitted] if fit.robot else []
    errors = errors_of(fit, model) if fit.dataset.level == "bench" else {}
    effects = model_to_dict(model).get("effects", {})
    for name, values in model.effects.items():
        if torques_of(name):
            effects[cause_of(name)]["droop_rpm"] = droop_rpm(name, values, model)
    return {
        "coefficients": dict(zip(COEFFICIENTS, law.coefficients.tolist(), strict=True)),
        "poles": [[float(p.real), float(p.imag)] for p in law.poles],
        "rise_time_s": step.rise_time_s,
        "settling_time_s": step.settling_time_s,
        "effects": effects,
        "robot": {name: getattr(model.robot, name) for name in robot},
        "rms_rpm": {split: one.rms_rpm for split, one in errors.items()},
        "max_error_rpm": {split: one.max_rpm for split, one in errors.items()},
        "notes": [note for note in model.provenance.get("notes", ()) if note not in fit.notes],
    }
