"""Measuring, from the logs that a model was fitted to, how far the model itself is off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.model_error import (
    ChannelError,
    ModelError,
    Residual,
    estimate_model_error,
    with_model_error,
)
from sysid.compare.noise import Noise, measure_noise
from sysid.compare.nuisance import plausible_models, shape_columns
from sysid.compare.observations import Observations, observe
from sysid.compare.problem import marginal_square
from sysid.compare.simulator import Simulator
from sysid.compare.subset import most_active_runs
from sysid.compare.whitening import Whitener
from sysid.logs import Dataset

SECONDS: Final = {"bench": 300.0, "robot": 60.0}
"""Of log that are simulated; a robot on its rollers takes long."""
_FACTORS: Final = (1.0, 1.25, 1.6, 2.0, 2.5, 3.2, 4.0)


def with_own_error(model: Model, dataset: Dataset) -> Model:
    """Return a model whose file states how far it is off from the logs it was fitted to, noise taken off.

    The two numbers a channel are raised, if they must be, until the square sum that they leave is no more
    than the number of samples, as a study of the gap will count.

    Args:
        model: as fitted.
        dataset: the logs it was fitted to.
    """
    observations = observe(replace(dataset, runs=most_active_runs(dataset.runs, SECONDS[dataset.level])))
    noise = measure_noise(dataset, observations)
    simulator = Simulator(observations)
    predicted = simulator.predictions(model)
    residual = [block.value - p for block, p in zip(observations.blocks, predicted, strict=True)]
    found = estimate_model_error(block_residuals(observations, noise, residual), dataset.sha256)
    law = [simulator.predictions(moved) for moved in plausible_models(model)]
    moved = [[p - q for p, q in zip(parts, predicted, strict=True)] for parts in law]
    for factor in _FACTORS:
        error = _scaled(found, factor)
        whitener = Whitener(observations, noise, error)
        columns = [*moved, *shape_columns(model, error, observations)]
        if marginal_square(whitener, residual, columns) <= whitener.size:
            break
    return with_model_error(model, error)


def block_residuals(observations: Observations, noise: Noise, parts: Sequence[FloatArray]) -> list[Residual]:
    """Return residuals with their runs and their noise.

    Args:
        observations: whose blocks they are of.
        noise: of each channel.
        parts: measured minus predicted, one array (m,) a block.
    """
    return [
        Residual(
            observations.situations[block.situation].runs[0],
            block.channel,
            block.time_s,
            part,
            noise.sigma[block.channel] ** 2 / block.weight,
        )
        for block, part in zip(observations.blocks, parts, strict=True)
    ]


def _scaled(error: ModelError, factor: float) -> ModelError:
    channels = {
        name: ChannelError(factor * e.settled, factor * e.transient, e.correlation_s)
        for name, e in error.channels.items()
    }
    return ModelError(channels, error.data_sha256)
