"""The residual of any model on the runs of a study, whitened and with the model's own error taken off.

A whitened residual r (N,) of the right model is normal with covariance I + X X', X the columns of
`sysid.compare.nuisance`. With X = U S V', W = I - U (1 - 1 / sqrt(1 + S^2)) U' makes it white: |W r|^2 is the
square sum that remains when the model's own error has explained what it can.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Final, TypeVar

import numpy as np

from mecanum_env.effects import CATALOGUE
from mecanum_env.errors import MecanumError
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.descent import Mask
from sysid.compare.nuisance import plausible_models, shape_columns
from sysid.compare.simulator import Simulator, model_key
from sysid.compare.study import Study, speed_scale
from sysid.compare.whitening import Whitener

UNUSABLE: Final = (MecanumError, ValueError)
"""What a model raises that cannot be simulated; MuJoCo refuses a latency too long by ValueError."""
SMOOTH_STEP: Final = 1e-3
"""Of a difference quotient on the scale 0 .. 1 of a parameter."""
ROLLER_STEP: Final = 0.02
"""The same on rollers, which meet the floor a little earlier or later: a smaller step shows mostly that."""
SMOOTH_PROBE: Final = 0.03
ROLLER_PROBE: Final = 0.15
_TURNS: Final = 4
"""Draws of the angles at which wheels start."""
_TURNED: Final = 0.1
"""From so much on the angles count as unknown."""
_COHERENT: Final = 1.5
"""What unknown angles leave differs from draw to draw by a third of it or so: few wheels, few runs."""
_HARDLY: Final = (1e-3, -1e-3, 2e-3)
"""Changes of the wheels' speed that no log shows."""
OF_THE_ROLLERS: Final = frozenset(
    [name for name, effect in CATALOGUE.items() if "planar" in effect.refused_by]
    + ["com_offset", "weak_servo"]
)
"""Effects that act by how rollers bear on the floor: the planar plant lacks them, or shows half of them."""

T = TypeVar("T")
U = TypeVar("U")


class ResidualProblem:
    """Residuals of models on some observations.

    Args:
        base: the model under study, whose error and uncertainty count.
        whitener: of the observations.
        study: settings of the simulations; its `scale` is set here, from the model and the runs.
    """

    def __init__(self, base: Model, whitener: Whitener, study: Study | None = None) -> None:
        self.base, self.whitener = base, whitener
        self.observations = whitener.observations
        runs = [run for situation in self.observations.situations for run in situation.runs]
        self.study = replace(study or Study(), scale=speed_scale(base, runs))
        self.simulator = Simulator(self.observations, self.study)
        self.bench = runs[0].level == "bench"
        rollers = not self.bench and self.study.plant == "rollers"
        planar = replace(self.study, plant="planar")
        self._planar = Simulator(self.observations, planar) if rollers else None
        self._turned = (
            [Simulator(self.observations, self.study, wheel_angle_seed=k) for k in range(1, _TURNS + 1)]
            if rollers
            else []
        )
        self.angle_uncertainty = 0.0
        """How far the wheels' angles at the start are unknown: 0 as in the simulation .. 1 anyhow."""
        self.measured = whitener.whiten(whitener.measured())
        self.base_residual = self._required(base)
        self.nuisance = self._nuisance()
        """X, shape (N, q)."""
        left, size, _ = np.linalg.svd(self.nuisance, full_matrices=False)
        self._left, self._grow = left, np.sqrt(1.0 + size**2)
        self._rough: dict[str, FloatArray] = {}

    @property
    def size(self) -> int:
        """Values compared."""
        return self.whitener.size

    @property
    def has_surrogate(self) -> bool:
        """Whether there is a quicker simulation than that of `residual`."""
        return self._planar is not None

    def residual(self, model: Model) -> FloatArray | None:
        """Return the whitened residual (N,) of a model, None where it cannot be simulated."""
        return self._residual(self.simulator, model)

    def _residual(self, simulator: Simulator, model: Model) -> FloatArray | None:
        try:
            predictions = simulator.predictions(model)
        except UNUSABLE:
            return None
        return self.measured - self.whitener.whiten(predictions)

    def surrogate_covers(self, effects: Sequence[str]) -> bool:
        """Return whether the surrogate is cheaper than `residual` and shows what `effects` change."""
        return self._planar is not None and not OF_THE_ROLLERS.intersection(effects)

    def surrogate_mask(self, owners: Sequence[str]) -> Mask:
        """Return of which parameters `surrogate_residual` tells what they change, (p,).

        Args:
            owners: the effect that each belongs to.
        """
        return np.array([self.surrogate_covers([owner]) for owner in owners], bool)

    def probe_step(self, effects: Sequence[str]) -> float:
        """Return the step to a first response of `effects` where that has a gradient, on the same scale."""
        return SMOOTH_PROBE if self._planar is None or self.surrogate_covers(effects) else ROLLER_PROBE

    def surrogate_residual(self, model: Model) -> FloatArray | None:
        """Return the whitened residual (N,) of a model on the planar plant, a tenth of the work.

        Only its differences mean something: without slip and without the effects that the plant refuses they
        are those of the rollers to some percent, and smooth where the rollers' are rough. On the bench it is
        `residual`.
        """
        if self._planar is None:
            return self.residual(model)
        left = {n: v for n, v in model.effects.items() if "planar" not in CATALOGUE[n].refused_by}
        return self._residual(self._planar, replace(model, effects=left))

    def changes(
        self, models: Sequence[Model], *, surrogate: bool, reference: Model
    ) -> list[FloatArray | None]:
        """Return how each model's marginal residual differs from that of another, (N,).

        Args:
            models: `study.jobs` of them at a time; None where one cannot be simulated.
            surrogate: whether to simulate with `surrogate_residual`.
            reference: the model that the others are compared with.
        """
        of = self.surrogate_residual if surrogate else self.residual
        unmoved = of(reference) if models else None

        def change(model: Model) -> FloatArray | None:
            moved = of(model)
            return None if moved is None or unmoved is None else self.marginal(moved - unmoved)

        return self.map(change, models)

    def map(self, work: Callable[[T], U], items: Iterable[T]) -> list[U]:
        """Return `work` of each item, in order; `study.jobs` at a time."""
        if self.study.jobs == 1:
            return [work(item) for item in items]
        # Threads: MuJoCo lets go of the interpreter while it steps.
        with ThreadPoolExecutor(self.study.jobs) as pool:
            return list(pool.map(work, items))

    def marginal(self, residual: FloatArray) -> FloatArray:
        """Return W times a residual (N,) or columns (N, p)."""
        return self._scaled(residual, 1.0 / self._grow - 1.0)

    def marginal_inverse(self, residual: FloatArray) -> FloatArray:
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

    def roller_scatter(self, model: Model) -> FloatArray:
        """Return what rollers that meet the floor otherwise would change, (N, k), each by one sigma.

        What hardly visible changes of the model do on the rollers, less what they do without rollers; no
        columns where there are no rollers.

        Args:
            model: where; it is measured once.
        """
        if not self.has_surrogate:
            return np.zeros((self.size, 0))
        key = f"{self.angle_uncertainty} {model_key(model)}"
        if key not in self._rough:
            here, columns = self._by_rollers(model), []
            gain = model.effects.get("speed_gain", {}).get("gain", 1.0)
            for change in _HARDLY:
                there = self._by_rollers(model.with_effect("speed_gain", gain=gain * (1.0 + change)))
                if here is not None and there is not None:
                    columns.append(self.marginal(there - here))
            found = np.stack(columns, axis=1) / np.sqrt(len(columns)) if columns else np.zeros((self.size, 0))
            if self.angle_uncertainty:
                found = np.concatenate([found, self._by_turning(model)], axis=1)
            self._rough[key] = found
        return self._rough[key]

    def update_angle_uncertainty(self, model: Model, residual: FloatArray) -> bool:
        """Find out whether the logs' wheels started at other angles than the simulated ones, and keep it.

        Which roller meets the floor when shows as a ripple. Of the change d by other angles the residual of a
        right model has nothing where the angles are those of the logs, and -d / 2 on average where not.

        Args:
            model: the best that was found.
            residual: its marginal residual (N,).

        Returns:
            Whether more is unknown of the angles than was thought; `rough` is larger then.
        """
        ripple, left = self._steps(self._turning(model)), self._steps(residual[:, None])
        square = float(np.sum(ripple**2))
        unknown = min(1.0, -2.0 * float(np.sum(ripple * left)) / square) if square > 0.0 else 0.0
        if unknown < max(_TURNED, self.angle_uncertainty + _TURNED):
            return False
        self.angle_uncertainty = unknown
        return True

    def _by_turning(self, model: Model) -> FloatArray:
        """Return what unknown angles of the wheels leave of a right model, (N, k), each by one sigma."""
        blocks = self.observations.blocks
        repeats = np.concatenate([np.full(block.value.size, float(block.repeats)) for block in blocks])
        # Two draws differ by twice the variance of one; the repeats' mean is of several, the prediction one.
        share = self.angle_uncertainty * 0.5 * (1.0 + 1.0 / repeats) * _COHERENT
        turning = self._turning(model)
        return np.asarray(turning * np.sqrt(share)[:, None] / math.sqrt(max(1, turning.shape[1])))

    def _turning(self, model: Model) -> FloatArray:
        """Return how the marginal residual differs where the wheels start at other angles, (N, k)."""
        here = self.residual(model)
        there = self.map(lambda simulator: self._residual(simulator, model), self._turned)
        found = [self.marginal(one - here) for one in there if one is not None and here is not None]
        return np.stack(found, axis=1) if found else np.zeros((self.size, 0))

    def _steps(self, columns: FloatArray) -> FloatArray:
        """Return the second differences of columns (N, p) within each block: what ripples, not what lasts."""
        return np.concatenate([np.diff(columns[place], 2, axis=0) for place in self.whitener.slices])

    def _by_rollers(self, model: Model) -> FloatArray | None:
        """Return how the rollers' residual of a model differs from that without rollers, (N,)."""
        full, quick = self.residual(model), self.surrogate_residual(model)
        return None if full is None or quick is None else full - quick

    def _nuisance(self) -> FloatArray:
        quick = self.surrogate_residual(self.base)

        def column(model: Model) -> FloatArray | None:
            moved = self.surrogate_residual(model)
            if moved is not None and quick is not None and np.any(moved != quick):
                return quick - moved
            moved = self.residual(model)
            return None if moved is None else self.base_residual - moved

        columns = [c for c in self.map(column, plausible_models(self.base)) if c is not None]
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
