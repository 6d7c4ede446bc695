"""Nuisance columns: changes of a prediction that the model's own error and uncertain parameters can cause.

There are three kinds. Each column is scaled so that its unknown factor is standard normal:

- the law's coefficients and the robot's fitted parameters, by the covariance that the model states;
- the shape of the response: after each change of command the model errs by size x g(time since, |size|) with
  the same g every time, a sum of hat functions of time and size with the size of the model's own error;
- the speed reached: the model errs by a function of the commanded speed, a sum of hat functions.

Residuals are marginalised over these factors, r' (I + X X')^-1 r: what they explain is not a gap.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from mecanum_env.effects import CATALOGUE
from mecanum_env.errors import MecanumError
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.measured import WINDOW_S, Block, Observations, Situation
from sysid.compare.model_error.adopted import ADOPTED
from sysid.compare.model_error.shape import command_levels, hat, kind_of
from sysid.compare.model_error.size import DECAY_S, ModelError
from sysid.compare.model_error.whitening import VELOCITY_OF, error_of

_TIMES_S: Final = (0.0, 0.02, 0.06, 0.11, 0.18, 0.30, 0.50)
"""Corners of the hat functions of time [s]; the first and the last have no hat of their own."""
_SIZES_RPM: Final = (0.0, 30.0, 80.0, 130.0)
"""Corners of the hat functions of the size of a change and, without 0, of the speed reached [rpm]."""
_NEGLIGIBLE: Final = 1e-10  # relative to the largest eigenvalue of a covariance: rounding errors


def plausible_models(model: Model) -> list[Model]:
    """Return models one standard deviation away along each axis of the covariances that the model states.

    They are those of the fit, and of the effects that studies have added since.
    """
    return [*fitted_variants(model), *adopted_variants(model)]


def fitted_variants(model: Model) -> list[Model]:
    """Return the plausible models as the fit allows them: its law, its effects, its robot."""
    found = _variants(model, model.uncertainty.get("joint") or model.uncertainty.get("wheel") or {})
    for name, error in (model.uncertainty.get("robot") or {}).items():
        value = getattr(model.robot, name, None)
        if isinstance(value, float) and isinstance(error, int | float) and error > 0.0:
            step = min(float(error), 0.3 * value)
            if step > 0.0:
                moved: dict[str, Any] = {name: value + step}
                found.append(replace(model, robot=replace(model.robot, **moved)))
    return found


def adopted_variants(model: Model) -> list[Model]:
    """Return the plausible models as the studies allow them that added effects, see `adopted`."""
    return _variants(model, model.uncertainty.get(ADOPTED) or {})


def _variants(model: Model, stated: Mapping[str, Any]) -> list[Model]:
    """Return models one standard deviation away along the axes of one `stated` covariance, if it is known."""
    covariance = stated.get("covariance")
    names = [str(name) for name in stated.get("names", COEFFICIENTS)]
    if not covariance or len(covariance) != len(names):
        return []
    # The numbers have different units: the axes are those of the correlation.
    matrix = np.asarray(covariance, float)
    scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    correlation = matrix / np.outer(scale, scale).clip(min=1e-300)
    values, vectors = np.linalg.eigh(correlation)
    return [
        moved
        for value, vector in zip(values, vectors.T, strict=True)
        if value > _NEGLIGIBLE * values[-1]
        for moved in _moved(model, names, math.sqrt(value) * vector * scale)
    ]


def _moved(model: Model, names: Sequence[str], step: FloatArray) -> list[Model]:
    """Return the model with its numbers moved by `step`, or by -step if that cannot be simulated, or none.

    The parameters of effects stay within what can be simulated.
    """
    law = model.wheel.law
    for sign in (1.0, -1.0):
        coefficients = dict(zip(COEFFICIENTS, law.coefficients.tolist(), strict=True))
        effects = {name: dict(values) for name, values in model.effects.items()}
        try:
            for name, change in zip(names, step, strict=True):
                if name in coefficients:
                    coefficients[name] += sign * float(change)
                    continue
                effect, _, parameter = name.rpartition(".")
                low, high = _valid(effect, parameter)
                value = effects[effect][parameter] + sign * float(change)
                effects[effect][parameter] = min(max(value, low), high)
            changed = replace(law, **coefficients).require_stable()
            return [replace(model, wheel=replace(model.wheel, law=changed), effects=effects)]
        except (MecanumError, KeyError):
            continue
    return []


def _valid(effect: str, parameter: str) -> tuple[float, float]:
    """Return the range of a parameter that can be simulated."""
    return next(p.valid for p in CATALOGUE[effect].parameters if p.name == parameter)


def shape_columns(
    model: Model, error: ModelError | None, observations: Observations
) -> list[list[FloatArray]]:
    """Return the columns for the response's shape and the speed reached: one array (m,) per block each.

    The model's own error scales them; None gives no column.
    """
    if error is None:
        return []
    columns: dict[tuple[str, str, int, int], list[FloatArray]] = {}
    for index, block in enumerate(observations.blocks):
        kind = kind_of(block.channel)
        stated = error_of(error, block.channel)
        if stated is None:
            continue
        for key, part in _block_columns(model, observations.situations[block.situation], block).items():
            size = stated.transient if key[0] == "change" else stated.settled
            if size == 0.0 or not np.any(part):
                continue
            column = columns.setdefault((kind, *key), [np.zeros(b.value.size) for b in observations.blocks])
            column[index] = size * part
    return list(columns.values())


def _block_columns(
    model: Model, situation: Situation, block: Block
) -> dict[tuple[str, int, int], FloatArray]:
    """Return (kind, time hat, size hat) -> column of a block, for a model error of size 1."""
    times, commands = command_levels(model, situation, block.channel)
    # A displacement spans a window, over which its column is averaged.
    around = np.linspace(-0.5 * WINDOW_S, 0.5 * WINDOW_S, 21) if block.channel in VELOCITY_OF else np.zeros(1)
    at = block.time_s[:, None] + around
    columns = {}
    steps = np.diff(commands)
    held = commands[np.clip(np.searchsorted(times, at, side="right") - 1, 0, None)]
    for j in range(1, len(_SIZES_RPM)):
        for i in range(1, len(_TIMES_S) - 1):
            total = np.zeros(at.shape)
            for when, step in zip(times[1:], steps, strict=True):
                share = float(step * hat(abs(step), _SIZES_RPM, j))
                if share != 0.0:
                    total += share * hat(at - when, _TIMES_S, i)
            columns["change", i, j] = math.exp(-_TIMES_S[i] / DECAY_S) * total.mean(axis=1)
        columns["reached", 0, j] = (np.sign(held) * hat(np.abs(held), _SIZES_RPM, j)).mean(axis=1)
    return columns
