"""Nested friction models on the fitted law, chosen by an information criterion, as in Rhoban's BAM.

Viscous, Coulomb, both, and both with a Stribeck term, with and without integral action of the drive. Each is
first fitted to the nominal logs, so that what the simulator always lacked is not taken for a change.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from mecanum_env.model import Model
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.studies.gapbench.adapters.fitting import Fitted, Logs, independent
from sysid.studies.gapbench.cases import Answer, BenchCase, Bounds, predicted

_MODELS: Final[tuple[tuple[str, ...], ...]] = (
    ("viscous_friction",),
    ("coulomb_friction",),
    ("viscous_friction", "coulomb_friction"),
    ("viscous_friction", "coulomb_friction", "stiction"),
)
"""Names of each model, the simplest first."""
_FORMS: Final = ("droop", "washed_out")
_LARGEST: Final = {"viscous_friction": 0.5, "coulomb_friction": 0.3, "stiction": 0.5}
"""Largest droop, as a share of the speed, or of the largest speed."""
_START: Final = 0.05
_BETTER: Final = 10.0
"""Difference of the criterion that is strong evidence."""
_LEVEL: Final = 1.64
"""Standard deviations of a 90 % interval."""


def answer(case: BenchCase) -> Answer:
    """Return the friction that the criterion adds to the simulator, or "no gap" if it adds none."""
    top = max(float(np.nanmax(np.abs(run.channels["speed_rpm"]))) for run in case.changed.runs)
    nominal, changed = Logs(case.nominal.runs), Logs(case.changed.runs)
    usual = changed.fit(lambda _: case.model, (), (), ())
    samples = independent(changed.errors(case.model))
    best: tuple[float, tuple[str, ...], str, Fitted] = (usual.bic(samples) - _BETTER, (), "", usual)
    for form in _FORMS:
        for names in _MODELS:
            found = _fitted(case.model, names, form, top, changed)
            if found.bic(samples) < best[0]:
                best = found.bic(samples), names, form, found
    _, names, form, found = best
    if not names:
        return Answer("no_gap")
    before = _fitted(case.model, names, form, top, nominal)
    new = [
        name
        for name, value, spread, old in zip(names, found.values, found.deviations, before.values, strict=True)
        if value - old > _LEVEL * spread and value > 2.0 * old
    ]
    if not new:
        return Answer("no_gap")
    model = _with(case.model, names, form, top, found.values)
    effects: dict[str, dict[str, Bounds]] = {name: {} for name in new}
    for name, value, spread in zip(names, found.values, found.deviations, strict=True):
        if name in new and name != "viscous_friction":
            droop, error = value * top, _LEVEL * spread * top
            effects[name]["droop_rpm"] = (droop, max(droop - error, 0.0), droop + error)
    return Answer("named", effects, predictions=predicted(model, case))


def _fitted(model: Model, names: Sequence[str], form: str, top_rpm: float, logs: Logs) -> Fitted:
    """Return the droops of a friction model that fit logs best, as shares of the (top) speed."""
    low, high = [0.0] * len(names), [_LARGEST[name] for name in names]
    return logs.fit(lambda x: _with(model, names, form, top_rpm, x), [_START] * len(names), low, high)


def _with(model: Model, names: Sequence[str], form: str, top_rpm: float, shares: FloatArray) -> Model:
    """Return the model with frictions of some sizes: droops as shares of the speed or of the top speed."""
    servo = model.robot.servo_n_m_s_rad
    for name, share in zip(names, shares.tolist(), strict=True):
        torque = share * top_rpm * RAD_S_PER_RPM * servo
        if name == "viscous_friction":
            model = model.with_effect(name, form, damping_n_m_s_rad=share * servo)
        elif name == "coulomb_friction":
            model = model.with_effect(name, form, torque_n_m=torque)
        else:
            model = model.with_effect(name, form, breakaway_n_m=torque, stribeck_rpm=0.05 * top_rpm)
    return model
