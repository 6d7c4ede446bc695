"""All effects at once by CMA-ES, as PACE fits a robot's simulator; the largest significant one is named.

One parameter per cause, each 0 where its effect is absent. An effect is as large as the error grows when it
alone is taken out of the best simulator; what cannot be told apart on a bench is offered together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import cma
import numpy as np

from mecanum_env.model import Model
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.studies.gapbench.adapters.fitting import Logs, independent
from sysid.studies.gapbench.adapters.residuals import TWINS, has_changed, usual_error
from sysid.studies.gapbench.cases import Answer, BenchCase, predicted

_EVALUATIONS: Final = 1500
_SPREAD: Final = 0.2
"""Of the first generation, as a share of each range."""
_SEED: Final = 1
_BETTER: Final = 10.0
"""Difference of the Bayesian criterion that is strong evidence."""
_EXPLAINED: Final = 2.0
"""Error left, over that in nominal logs, above which a small effect is no explanation."""

Sized = Callable[[float, float, float], Mapping[str, float]]
"""(size, top speed [rpm], servo stiffness [N m s/rad]) -> parameters of an effect."""


@dataclass(frozen=True)
class _Cause:
    """One effect with one size from 0 (or -1, for those that have a sign) to 1."""

    name: str
    sized: Sized
    signed: bool = False


_CAUSES: Final = (
    _Cause("command_latency", lambda x, _t, _s: {"delay_s": 0.3 * x}),
    _Cause("command_deadband", lambda x, top, _s: {"threshold_rpm": 0.5 * top * x}),
    _Cause("speed_gain", lambda x, _t, _s: {"gain": 1.0 + 0.4 * x}, signed=True),
    _Cause("direction_asymmetry", lambda x, _t, _s: {"reverse_ratio": 1.0 + 0.4 * x}, signed=True),
    _Cause("battery_sag", lambda x, _t, _s: {"drop_per_s": 0.05 * x}),
    _Cause("warm_up", lambda x, _t, _s: {"share": 0.4 * x, "time_constant_s": 2.0}, signed=True),
    _Cause("speed_saturation", lambda x, top, _s: {"limit_rpm": top * (1.0 - 0.6 * x)}),
    _Cause("acceleration_limit", lambda x, top, _s: {"limit_rpm_s": top / x}),
    _Cause("load_inertia", lambda x, _t, _s: {"ratio": 1.0 + 5.0 * x}),
    _Cause("backlash", lambda x, _t, _s: {"gap_deg": 40.0 * x}),
    _Cause("coulomb_friction", lambda x, top, servo: {"torque_n_m": 0.4 * x * top * RAD_S_PER_RPM * servo}),
    _Cause(
        "stiction",
        lambda x, top, servo: {
            "breakaway_n_m": 0.4 * x * top * RAD_S_PER_RPM * servo,
            "stribeck_rpm": 0.05 * top,
        },
    ),
    _Cause("viscous_friction", lambda x, _t, servo: {"damping_n_m_s_rad": 0.5 * x * servo}),
    _Cause("sensor_lowpass", lambda x, _t, _s: {"time_constant_s": 0.3 * x}),
)


def answer(case: BenchCase) -> Answer:
    """Return the largest significant effect of the best simulator that CMA-ES finds."""
    if not has_changed(case):
        return Answer("no_gap")
    logs = Logs(case.changed.runs)
    top = max(float(np.max(np.abs(run.command.wheels_rpm))) for run in case.changed.runs)
    samples = independent(logs.errors(case.model))

    def cost(sizes: FloatArray) -> float:
        return samples * math.log(float(np.mean(logs.errors(_model(case.model, sizes, top)) ** 2)))

    best = _searched(cost)
    least = cost(best)
    grows = np.array([cost(np.where(np.arange(best.size) == i, 0.0, best)) - least for i in range(best.size)])
    largest = int(np.argmax(grows))
    model = _model(case.model, best, top)
    predictions = predicted(model, case)
    if grows[largest] < _BETTER + math.log(samples):
        return Answer("unexplained", predictions=predictions)
    left = float(np.sqrt(np.mean(logs.errors(model) ** 2)))
    if left > _EXPLAINED * usual_error(case) and grows[largest] < 2.0 * _BETTER:
        return Answer("unexplained", predictions=predictions)
    name = _CAUSES[largest].name
    if name in TWINS:
        return Answer("ambiguous", candidates=((name,), (TWINS[name],)), predictions=predictions)
    return Answer("named", {name: {}}, predictions=predictions)


def _searched(cost: Callable[[FloatArray], float]) -> FloatArray:
    """Return the sizes of all causes with the least cost that CMA-ES finds, each of shape (p,)."""
    low = [-1.0 if cause.signed else 0.0 for cause in _CAUSES]
    begin = [0.0 if cause.signed else 0.05 for cause in _CAUSES]
    options = {
        "bounds": [low, [1.0] * len(low)],
        "maxfevals": _EVALUATIONS,
        "seed": _SEED,
        "verbose": -9,
    }
    found, _ = cma.fmin2(cost, begin, _SPREAD, options)
    return np.asarray(found, dtype=float)


def _model(model: Model, sizes: FloatArray, top_rpm: float) -> Model:
    """Return the model with effects of some sizes, shape (p,); those of size 0 are left out."""
    for cause, size in zip(_CAUSES, sizes.tolist(), strict=True):
        if abs(size) > 1e-6:
            model = model.with_effect(
                cause.name, None, **cause.sized(size, top_rpm, model.robot.servo_n_m_s_rad)
            )
    return model
