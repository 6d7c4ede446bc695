"""How certain the law and the effects are that were fitted together, as a model file states it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.least_squares import Fitted
from sysid.compare.search_space import LawWithEffects

_STEP = 1e-5  # of a finite difference of the coefficients, which are smooth functions of the place
_NORMAL_90: Final = 1.645


def with_uncertainty(
    base: Model, fitted: Fitted[LawWithEffects], inflation: float
) -> tuple[Model, FloatArray]:
    """Return the fitted model with the uncertainty of law and effects, and the covariance (6, 6) of A-F.

    `base` is the model that was fitted, and `inflation` the variance of the residual relative to the noise.
    """
    names, covariance = joint_covariance(fitted, base, inflation)
    of_law = covariance[: len(COEFFICIENTS), : len(COEFFICIENTS)]
    stated = {
        "wheel": {
            **base.uncertainty.get("wheel", {}),
            "names": list(COEFFICIENTS),
            "covariance": of_law.tolist(),
        },
        "effects": _intervals(fitted, inflation),
        "joint": {"names": names, "covariance": covariance.tolist()},
    }
    model = fitted.candidate.model(base, fitted.place)
    return replace(model, uncertainty={**base.uncertainty, **stated}), of_law


def _intervals(fitted: Fitted[LawWithEffects], inflation: float) -> dict[str, dict[str, dict[str, float]]]:
    """Return effect -> parameter -> value and 90 % interval, as a model file states them."""
    effects, count = fitted.candidate.effects, fitted.candidate.law.parameter_count
    spread = np.sqrt(np.diag(fitted.covariance(inflation)))[count:] * _NORMAL_90
    place = fitted.place[count:]
    found: dict[str, dict[str, dict[str, float]]] = {}
    for effect, intervals in effects.intervals(place, place - spread, place + spread).items():
        for parameter, ends in intervals.items():
            if all(map(math.isfinite, ends)):
                values = dict(zip(("value", "low", "high"), ends, strict=True))
                found.setdefault(effect, {})[parameter] = values
    return found


def joint_covariance(
    fitted: Fitted[LawWithEffects], base: Model, inflation: float
) -> tuple[list[str], FloatArray]:
    """Return the names and the covariance (n, n) of all that was fitted together, in the model's own units.

    The names are A-F and then "EFFECT.PARAMETER" of each free parameter that has a finite value. `base` is
    the model that was fitted, and `inflation` the variance of the residual relative to the noise. As five
    numbers give A-F (the law's DC gain is kept), the matrix is singular.
    """
    candidate, place = fitted.candidate, fitted.place
    count = candidate.law.parameter_count

    def coefficients(at: FloatArray) -> FloatArray:
        return np.asarray(candidate.law.model(base, at).wheel.law.coefficients, float)

    slope = np.zeros((len(COEFFICIENTS) + candidate.effects.parameter_count, place.size))
    for index, step in enumerate(_STEP * np.eye(count)):
        change = coefficients(place[:count] + step) - coefficients(place[:count] - step)
        slope[: len(COEFFICIENTS), index] = change / (2.0 * _STEP)
    names, rows = list(COEFFICIENTS), list(range(len(COEFFICIENTS)))
    for index, one in enumerate(candidate.effects.coordinates):
        at = float(place[count + index])
        # One-sided at a bound, beyond which a place has no value.
        low, high = max(0.0, at - _STEP), min(1.0, at + _STEP)
        moved = one.value(high) - one.value(low)
        if math.isfinite(one.value(at)) and math.isfinite(moved):
            names.append(f"{one.effect}.{one.parameter}")
            rows.append(len(COEFFICIENTS) + index)
            slope[rows[-1], count + index] = moved / (high - low)
    slope = slope[rows]
    return names, np.asarray(slope @ fitted.covariance(inflation) @ slope.T)
