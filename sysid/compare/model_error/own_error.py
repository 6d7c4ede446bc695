"""Measuring a model's own error on the logs that it was fitted to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress

import numpy as np

from mecanum_env.errors import MecanumError
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.measured import Observations, most_active, observe
from sysid.compare.model_error.nuisance import plausible_models, shape_columns
from sysid.compare.model_error.size import FACTORS, Residual, estimate_model_error, with_model_error
from sysid.compare.model_error.whitening import Whitener
from sysid.compare.noise import Noise, measure_noise
from sysid.compare.predicted import SimulationSettings, Simulator, without_engine_warnings
from sysid.logs import Dataset


def with_own_error(model: Model, dataset: Dataset, settings: SimulationSettings | None = None) -> Model:
    """Return a model whose file states its own error on the logs it was fitted to.

    The error of all channels is multiplied by the smallest factor of 1 to 4 with which the cost, counted as
    in a study of the gap, is no larger than the number of samples. Models that are as plausible, and that
    cannot be simulated, are left out.
    """
    observations = observe(most_active(dataset))
    noise = measure_noise(dataset, observations)
    simulator = Simulator(observations, settings or SimulationSettings())
    predicted = simulator.predictions(model)
    residual = [block.value - p for block, p in zip(observations.blocks, predicted, strict=True)]
    found = estimate_model_error(block_residuals(observations, noise, residual), dataset.sha256)
    plausible = list(_predictions(simulator, plausible_models(model)))
    changes = [[p - q for p, q in zip(parts, predicted, strict=True)] for parts in plausible]
    for factor in FACTORS:
        error = found.scaled(factor)
        whitener = Whitener(observations, noise, error)
        columns = [*changes, *shape_columns(model, error, observations)]
        if _marginal_cost(whitener, residual, columns) <= whitener.size:
            break
    return with_model_error(model, error)


def _predictions(simulator: Simulator, models: Sequence[Model]) -> Iterator[list[FloatArray]]:
    """Yield what each of some models predicts that can be simulated."""
    with without_engine_warnings():
        for model in models:
            with suppress(MecanumError):
                yield simulator.predictions(model)


def block_residuals(observations: Observations, noise: Noise, parts: Sequence[FloatArray]) -> list[Residual]:
    """Return residuals, one of the `parts` (m,) for each block, with their runs and noise variances."""
    return [
        Residual(
            observations.situations[block.situation].runs[0],
            block.channel,
            block.time_s,
            part,
            noise.variance(block, observations.situations[block.situation].runs[0]),
        )
        for block, part in zip(observations.blocks, parts, strict=True)
    ]


def _marginal_cost(
    whitener: Whitener, residual: Sequence[FloatArray], nuisance: Sequence[Sequence[FloatArray]]
) -> float:
    """Return r' (I + X X')^-1 r of a residual and the columns of the model's own error, not yet whitened."""
    r = whitener.whiten(residual)
    if not nuisance:
        return float(r @ r)
    x = np.stack([whitener.whiten(parts) for parts in nuisance], axis=1)
    along = x.T @ r
    return float(r @ r - along @ np.linalg.solve(np.eye(x.shape[1]) + x.T @ x, along))
