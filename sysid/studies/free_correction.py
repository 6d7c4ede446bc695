"""What a flexible regression takes off a model's error on test runs: the measure for named effects.

The difference between log and model is regressed on smooth functions of the commands, the speed and the time
(the columns of `sysid.compare.model_error.shape`, and some of the time in the run), with a penalty on their
factors that predicts left-out groups of runs best. No cause is behind it, and no other program could simulate
it; it shows how much of the difference is there to be explained at all. The rest is noise or depends on
something else.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.links import AlignedLogs
from sysid.compare.measured import Observations, observe
from sysid.compare.model_error import ShapeBasis
from sysid.compare.predicted import SimulationSettings, Simulators
from sysid.logs import Dataset
from sysid.logs.tails import weighted_down

_PENALTIES: Final = tuple(10.0 ** np.arange(-4.0, 3.0))
"""Penalties on the factors that are tried, relative to the mean square of the columns."""


def free_correction(dataset: Dataset, model: Model) -> tuple[float, float]:
    """Return the rms error of a model on the test runs of bench logs, and that with the correction [rpm].

    The correction is fitted to the fit and validation runs.
    """
    dataset, _ = weighted_down(dataset)
    late = AlignedLogs.stated(dataset, model)
    if late is not None:
        dataset, model = late.dataset, late.model
    known = _Table(dataset, model, ("fit", "validation"))
    unseen = _Table(dataset, model, ("test",), known.basis)
    keys = [key for key in known.columns if key in unseen.columns]
    x, x_unseen = (np.stack([t.columns[key] for key in keys], axis=1) for t in (known, unseen))
    penalty = min(_PENALTIES, key=lambda one: _left_out(x, known, one))
    after = unseen.residual - x_unseen @ _factors(x, known.residual, known.weight, penalty)
    return _rms(unseen.residual, unseen.count), _rms(after, unseen.count)


class _Table:
    """The residual in some runs and the columns that it is regressed on, one row for each value."""

    def __init__(
        self, dataset: Dataset, model: Model, splits: tuple[str, ...], basis: ShapeBasis | None = None
    ) -> None:
        runs = tuple(run for run in dataset.runs if run.split in splits)
        observations = observe(Dataset(dataset.name, runs, dataset.findings))
        predicted = Simulators.of(observations, SimulationSettings()).full.predictions(model)
        blocks = observations.blocks
        self.basis = basis or ShapeBasis.of(model, observations, predicted)
        self.residual = np.concatenate([b.value - p for b, p in zip(blocks, predicted, strict=True)])
        self.weight = np.concatenate([block.weight for block in blocks])
        self.count = np.concatenate(
            [(block.row_weights > 0.0).sum(axis=1) * block.repeats for block in blocks]
        )
        self.group = _groups(observations)
        shapes = self.basis.columns(model, observations, predicted)
        self.columns: dict[object, FloatArray] = {key: np.concatenate(parts) for key, parts in shapes.items()}
        speed = np.concatenate(predicted)
        time = np.concatenate([block.time_s for block in blocks])
        self.columns |= {
            "constant": np.ones(time.size),
            "time": time,
            "speed and time": np.sign(speed) * time,
            "faded": np.sign(speed) * np.exp(-time),
        }


def _groups(observations: Observations) -> FloatArray:
    names = list(dict.fromkeys(situation.group for situation in observations.situations))
    return np.concatenate(
        [
            np.full(block.value.size, float(names.index(observations.situations[block.situation].group)))
            for block in observations.blocks
        ]
    )


def _factors(x: FloatArray, residual: FloatArray, weight: FloatArray, penalty: float) -> FloatArray:
    """Return the factors of the columns `x` (n, q), (q,), by weighted ridge regression."""
    square = np.sum(weight[:, None] * x**2, axis=0)
    normal = x.T @ (weight[:, None] * x) + penalty * np.diag(np.maximum(square, 1e-12))
    return np.asarray(np.linalg.solve(normal, x.T @ (weight * residual)))


def _left_out(x: FloatArray, table: _Table, penalty: float) -> float:
    """Return the sum of squares of what is left in each group of runs if the others are fitted."""
    total = 0.0
    for group in np.unique(table.group):
        mine = table.group == group
        factors = _factors(x[~mine], table.residual[~mine], table.weight[~mine], penalty)
        total += float(table.weight[mine] @ (table.residual[mine] - x[mine] @ factors) ** 2)
    return total


def _rms(values: FloatArray, count: FloatArray) -> float:
    return float(np.sqrt(np.sum(count * values**2) / np.sum(count)))
