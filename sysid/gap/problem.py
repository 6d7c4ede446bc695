"""The residual of any model on the runs of a study, whitened and with the model's own error taken off.

A whitened residual r (N,) of the right model is normal with covariance I + X X', X the columns of
`sysid.gap.nuisance`. With X = U S V', W = I - U (1 - 1 / sqrt(1 + S^2)) U' makes it white: |W r|^2 is the
square sum that remains when the model's own error has explained what it can.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Final, TypeVar

import numpy as np

from mecanum_env.errors import MecanumError
from mecanum_env.mjcf.physics import TRAINING_TIMESTEP_S
from mecanum_env.model import Model
from mecanum_env.simulator import Plant
from mecanum_env.units import FloatArray
from sysid.gap.nuisance import plausible_models, shape_columns
from sysid.gap.scale import speed_scale
from sysid.gap.simulator import Simulator
from sysid.gap.whitening import Whitener

UNUSABLE: Final = (MecanumError, ValueError)
"""What a model raises that cannot be simulated; MuJoCo refuses a latency too long by ValueError."""
SMOOTH_STEP: Final = 1e-3
ROUGH_STEP: Final = 0.02
"""Rollers meet the floor a little earlier or later: what a smaller step changes is mostly that."""

SMOOTH_LOOK: Final = 0.03
ROUGH_LOOK: Final = 0.15

T = TypeVar("T")
U = TypeVar("U")


class Problem:
    """Residuals of models on some observations.

    Args:
        base: the model under study, whose error and uncertainty count.
        whitener: of the observations.
        jobs: simulations at a time.
        plant: of the robot.
    """

    def __init__(self, base: Model, whitener: Whitener, jobs: int = 1, plant: Plant = "rollers") -> None:
        self.base, self.whitener, self.jobs, self.plant = base, whitener, jobs, plant
        self.observations = whitener.observations
        self.simulator = Simulator(self.observations, plant=plant)
        runs = [run for situation in self.observations.situations for run in situation.runs]
        self.scale = speed_scale(base, runs)
        """Of the catalogue's bounds and grids in rpm and rpm/s."""
        self.bench = runs[0].level == "bench"
        robot = not self.bench and plant == "rollers"
        self.rough = robot
        """Whether small changes of a model change a simulation roughly: rollers meet the floor anew."""
        self.least_step = ROUGH_STEP if robot else SMOOTH_STEP
        """Of a difference quotient, on the scale 0 .. 1 of a parameter."""
        self.look_step = ROUGH_LOOK if robot else SMOOTH_LOOK
        """Of an effect's first response where that has a gradient, on the same scale."""
        # An effect's change is wanted to some percent only, and twice the step takes half the time.
        self._rough = Simulator(self.observations, TRAINING_TIMESTEP_S) if robot else self.simulator
        self.measured = whitener.whiten(whitener.measured())
        self.base_residual = self._required(base)
        self.nuisance = self._nuisance()
        """X, shape (N, q)."""
        left, size, _ = np.linalg.svd(self.nuisance, full_matrices=False)
        self._left, self._grow = left, np.sqrt(1.0 + size**2)

    @property
    def size(self) -> int:
        """Values compared."""
        return self.whitener.size

    def residual(self, model: Model) -> FloatArray | None:
        """Return the whitened residual (N,) of a model, None where it cannot be simulated."""
        try:
            predictions = self.simulator.predictions(model)
        except UNUSABLE:
            return None
        return self.measured - self.whitener.whiten(predictions)

    def changes(self, models: Sequence[Model]) -> list[FloatArray | None]:
        """Return how each model's marginal residual differs from the base model's, (N,), roughly.

        `jobs` at a time; None where a model cannot be simulated.
        """
        reference = self._rough.predictions(self.base)

        def change(model: Model) -> FloatArray | None:
            try:
                moved = self._rough.predictions(model)
            except UNUSABLE:
                return None
            parts = [before - after for before, after in zip(reference, moved, strict=True)]
            return self.marginal(self.whitener.whiten(parts))

        return self.map(change, models)

    def residuals(self, models: Sequence[Model]) -> list[FloatArray | None]:
        """Return the residual of each model; `jobs` at a time."""
        return self.map(self.residual, models)

    def map(self, work: Callable[[T], U], items: Iterable[T]) -> list[U]:
        """Return `work` of each item, in order; `jobs` at a time."""
        if self.jobs == 1:
            return [work(item) for item in items]
        # Threads: MuJoCo lets go of the interpreter while it steps.
        with ThreadPoolExecutor(self.jobs) as pool:
            return list(pool.map(work, items))

    def marginal(self, residual: FloatArray) -> FloatArray:
        """Return W times a residual (N,) or columns (N, p)."""
        return self._scaled(residual, 1.0 / self._grow - 1.0)

    def unmarginal(self, residual: FloatArray) -> FloatArray:
        """Return W^-1 times a residual (N,) or columns (N, p): the inverse of `marginal`."""
        return self._scaled(residual, self._grow - 1.0)

    def _scaled(self, residual: FloatArray, by: FloatArray) -> FloatArray:
        along = self._left.T @ residual
        scaled: FloatArray = residual + self._left @ (
            by * along if residual.ndim == 1 else by[:, None] * along
        )
        return scaled

    def _required(self, model: Model) -> FloatArray:
        """Return the residual of a model that must be simulated, errors raised."""
        return self.measured - self.whitener.whiten(self.simulator.predictions(model))

    def _nuisance(self) -> FloatArray:
        moved = self.residuals(plausible_models(self.base))
        columns = [self.base_residual - r for r in moved if r is not None]
        for parts in shape_columns(self.base, self.whitener.error, self.observations):
            columns.append(self.whitener.whiten(parts))
        return np.stack(columns, axis=1) if columns else np.zeros((self.size, 0))


def marginal_square(
    whitener: Whitener, residual: Sequence[FloatArray], nuisance: Sequence[Sequence[FloatArray]]
) -> float:
    """Return the square sum that a residual leaves when the model's own error has explained what it can.

    Args:
        whitener: of the observations.
        residual: measured minus predicted, one array (m,) a block.
        nuisance: columns of the model's own error, each one array (m,) a block.
    """
    r = whitener.whiten(residual)
    if not nuisance:
        return float(r @ r)
    x = np.stack([whitener.whiten(parts) for parts in nuisance], axis=1)
    along = x.T @ r
    return float(r @ r - along @ np.linalg.solve(np.eye(x.shape[1]) + x.T @ x, along))
