"""What earlier studies added to a model: how uncertain it is, and whether it is newer than the fit.

A model file keeps it as `uncertainty.adopted`: the covariance of the parameters of the adopted effects, and
which of these came after the logs of the fit. The next study counts the parameters as uncertain by that much,
and looks at the logs of the fit without what came later.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from scipy.stats import norm

from mecanum_env.model import Model, cause_of
from mecanum_env.units import FloatArray

ADOPTED: Final = "adopted"
"""Its key in the uncertainty of a model."""


def with_adopted(
    model: Model, names: Sequence[str], covariance: FloatArray, effects: Collection[str], new: Collection[str]
) -> Model:
    """Return a model whose file says how uncertain the effects are that a study added.

    What is known of the other effects stays, and what was known of these is replaced.

    Args:
        model: the model with the effects added.
        names: "EFFECT.PARAMETER" of each parameter with a known uncertainty, n of them.
        covariance: theirs, shape (n, n), in the parameters' units.
        effects: all effects that were added or fitted again.
        new: those that came after the logs of the model's fit.
    """
    causes = {cause_of(effect) for effect in effects}
    earlier = _of(model)
    kept, old = _without(earlier.get("names", ()), earlier.get("covariance", ()), causes)
    whole = np.zeros((len(kept) + len(names), len(kept) + len(names)))
    whole[: len(kept), : len(kept)] = old
    whole[len(kept) :, len(kept) :] = covariance
    still_new = [effect for effect in earlier.get("new", ()) if cause_of(effect) not in causes]
    stated: dict[str, Any] = {
        "names": [*kept, *names],
        "covariance": whole.tolist(),
        "new": [*still_new, *(effect for effect in effects if effect in new)],
    }
    uncertainty = {**model.uncertainty, ADOPTED: stated}
    if joint := uncertainty.get("joint"):
        left, matrix = _without(joint["names"], joint["covariance"], causes)
        uncertainty["joint"] = {**joint, "names": left, "covariance": matrix.tolist()}
    return replace(model, uncertainty=uncertainty)


def as_fitted(model: Model) -> Model:
    """Return a model without the effects that are newer than the logs of its fit."""
    new = _of(model).get("new", ())
    if not new:
        return model
    return replace(model, effects={name: values for name, values in model.effects.items() if name not in new})


def covariance_of(
    intervals: Mapping[str, tuple[float, float]],
    names: Sequence[str],
    place_covariance: FloatArray,
    level: float,
) -> tuple[list[str], FloatArray]:
    """Return the parameters of which the uncertainty is known, k of them, and their covariance (k, k).

    Args:
        intervals: "EFFECT.PARAMETER" -> ends of its interval; one that is not finite or has no width is left
            out.
        names: the parameters, n of them, whose correlations are known.
        place_covariance: gives these, shape (n, n).
        level: probability that an interval holds the truth.
    """
    sigmas = 2.0 * float(norm.ppf(0.5 * (1.0 + level)))
    wide = {
        name: (high - low) / sigmas
        for name, (low, high) in intervals.items()
        if math.isfinite(high - low) and high > low
    }
    found = list(wide)
    correlation = np.eye(len(found))
    spread = np.sqrt(np.diag(place_covariance)).clip(min=1e-300)
    for i, one in enumerate(found):
        for j, other in enumerate(found):
            if i != j and one in names and other in names:
                a, b = names.index(one), names.index(other)
                correlation[i, j] = place_covariance[a, b] / (spread[a] * spread[b])
    deviation = np.array(list(wide.values()))
    return found, np.asarray(correlation * np.outer(deviation, deviation), float)


def _of(model: Model) -> Mapping[str, Any]:
    stated = model.uncertainty.get(ADOPTED)
    return stated if isinstance(stated, Mapping) else {}


def _without(
    names: Sequence[str], covariance: Sequence[Sequence[float]], causes: Collection[str]
) -> tuple[list[str], FloatArray]:
    """Return names and covariance (k, k) without the parameters of some `causes`."""
    keep = [i for i, name in enumerate(names) if cause_of(name.rpartition(".")[0]) not in causes]
    matrix = np.asarray(covariance, float).reshape(len(names), len(names))
    return [names[i] for i in keep], matrix[np.ix_(keep, keep)]
