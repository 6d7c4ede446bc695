"""The residual of any model on the runs of a study, whitened and marginalised over the model's own error.

The whitened residual r (N,) of the right model is normal with covariance I + X X', X the columns of
`sysid.compare.nuisance`. With X = U S V', W = I - U (1 - 1 / sqrt(1 + S^2)) U' whitens it: |W r|^2 is the sum
of squares that remains after the model's own error has explained what it can.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from mecanum_env.effects import CATALOGUE
from mecanum_env.errors import MecanumError
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.descent import Mask
from sysid.compare.learned import Learned
from sysid.compare.nuisance import plausible_models, shape_columns
from sysid.compare.phases import with_unknown_phases
from sysid.compare.prediction import Study
from sysid.compare.scale import scale_of
from sysid.compare.simulator import Simulator, Simulators, model_key, planar_part
from sysid.compare.whitening import Whitener

_UNUSABLE: Final = (MecanumError, ValueError)
"""Exceptions of a model that cannot be simulated; MuJoCo raises ValueError for too long a latency."""
SMOOTH_STEP: Final = 1e-3
"""Step of a finite difference on the 0..1 scale of a parameter, where the simulation is smooth."""
ROLLER_STEP: Final = 0.1
"""The same on rollers: a smaller step shows mostly rollers that meet the floor a little earlier or later.
With 0.1 fits end lower than with 0.02 or 0.05, after as few simulations."""
_SMOOTH_PROBE: Final = 0.03
"""Step to the first response of an effect on the 0..1 scale, where the simulation is smooth."""
_ROLLER_PROBE: Final = 0.15
"""The same on rollers."""
_GAIN_CHANGES: Final = (1e-3, -1e-3, 2e-3)
"""Relative changes of the wheel speeds, far below what logs show, that change when rollers meet the floor."""

_ANGLE_STEP: Final = 0.1  # least increase of the uncertainty that is taken over
_INFLATION: Final = 1.5
"""Factor on the ripple's variance: over few wheels and runs it varies by about a third between draws."""


class ResidualProblem:
    """Residuals of models on some observations.

    On rollers it also has a surrogate: the planar plant, which takes a tenth of the time and is smooth. The
    error and the parameter uncertainty that the `base` model states are marginalised. The `scale` of the
    study is replaced by that of the model and the runs. The `simulators` of another problem of the same
    observations and study remember what they have simulated. With what was `learned` from the logs of the
    base model's fit, predictions are corrected by its mean, and its covariance is what is marginalised.
    """

    def __init__(
        self,
        base: Model,
        whitener: Whitener,
        study: Study | None = None,
        simulators: Simulators | None = None,
        learned: Learned | None = None,
    ) -> None:
        self.base, self.whitener = base, whitener
        self.observations = whitener.observations
        runs = [run for situation in self.observations.situations for run in situation.runs]
        self.study = replace(study or Study(), scale=scale_of(base, runs))
        self.simulators = simulators or Simulators.of(self.observations, self.study)
        self.bench = runs[0].level == "bench"
        self._ripple: WheelAngleRipple | None = None
        if self.simulators.planar is not None:
            self._ripple = WheelAngleRipple(self.simulators, whitener, self._residual, self.marginal)
        self.measured = whitener.whiten(whitener.measured())
        self.nuisance = np.zeros((self.size, 0))
        self.knows_all = learned is not None and not self.bench
        """Whether what every effect would do is among the model's own error, as far as the logs of its fit
        leave that open, so that only what is new counts."""
        if learned is not None:
            columns = whitener.whiten(learned.columns(self.simulators))
            self.measured = self.measured - columns @ learned.mean
            self.nuisance = columns @ learned.root
        self.base_residual = self.measured - whitener.whiten(self.simulators.full.predictions(base))
        if learned is None:
            self.nuisance = self._nuisance()
        """X, shape (N, q)."""
        directions, size, _ = np.linalg.svd(self.nuisance, full_matrices=False)
        self._directions, self._spread = directions, np.sqrt(1.0 + size**2)
        self._scatter: dict[Hashable, FloatArray] = {}

    @property
    def size(self) -> int:
        """Number N of compared values."""
        return self.whitener.size

    @property
    def has_surrogate(self) -> bool:
        """Whether there is a faster simulation than that of `residual`."""
        return self.simulators.planar is not None

    @property
    def angle_uncertainty(self) -> float:
        """How unknown the initial wheel angles are: 0 as in the simulation .. 1 entirely."""
        return 0.0 if self._ripple is None else self._ripple.uncertainty

    def residual(self, model: Model) -> FloatArray | None:
        """Return the whitened residual (N,) of a model, None if it cannot be simulated."""
        return self._residual(self.simulators.full, model)

    def _residual(self, simulator: Simulator, model: Model) -> FloatArray | None:
        def with_its_phases(one: Model) -> FloatArray | None:
            try:
                predictions = simulator.predictions(one)
            except _UNUSABLE:
                return None
            return self.measured - self.whitener.whiten(predictions)

        rows = self.whitener.slices
        return with_unknown_phases(with_its_phases, model, self.observations.blocks, rows)

    def surrogate_residual(self, model: Model) -> FloatArray | None:
        """Return the whitened residual (N,) of a model on the planar plant; on the bench that of `residual`.

        Only its differences are meaningful. Without slip and without the effects that the plant refuses they
        agree with those of the rollers to some per cent.
        """
        if self.simulators.planar is None:
            return self.residual(model)
        return self._residual(self.simulators.planar, planar_part(model))

    def surrogate_covers(self, effects: Sequence[str]) -> bool:
        """Return whether there is a surrogate and it shows what the `effects` change."""
        known = [CATALOGUE[name] for name in effects if name]
        return self.simulators.planar is not None and all(effect.fully_in("planar") for effect in known)

    def surrogate_mask(self, owners: Sequence[str]) -> Mask:
        """Return which parameters' influence the surrogate shows, (p,), by their effects `owners`, (p,)."""
        return np.array([self.surrogate_covers([owner]) for owner in owners], bool)

    def probe_step(self, effects: Sequence[str]) -> float:
        """Return the step to the first response of some `effects`, on the 0..1 scale of a parameter."""
        smooth = self.simulators.planar is None or self.surrogate_covers(effects)
        return _SMOOTH_PROBE if smooth else _ROLLER_PROBE

    def changes(
        self, models: Sequence[Model], *, surrogate: bool, reference: Model
    ) -> list[FloatArray | None]:
        """Return how the marginal residual (N,) of each model differs from that of the reference.

        It is None for a model that cannot be simulated. `surrogate`: simulate with `surrogate_residual`.
        """
        simulated = self.surrogate_residual if surrogate else self.residual
        unchanged = simulated(reference) if models else None

        def change(model: Model) -> FloatArray | None:
            changed = simulated(model)
            return None if changed is None or unchanged is None else self.marginal(changed - unchanged)

        return self.study.map(change, models)

    def marginal(self, residual: FloatArray) -> FloatArray:
        """Return W times a residual (N,) or columns (N, p)."""
        return self._scaled(residual, 1.0 / self._spread - 1.0)

    def marginal_inverse(self, residual: FloatArray) -> FloatArray:
        """Return W^-1 times a residual (N,) or columns (N, p)."""
        return self._scaled(residual, self._spread - 1.0)

    def _scaled(self, residual: FloatArray, factors: FloatArray) -> FloatArray:
        along = self._directions.T @ residual
        scaled = factors * along if residual.ndim == 1 else factors[:, None] * along
        return np.asarray(residual + self._directions @ scaled)

    def roller_scatter(self, model: Model) -> FloatArray:
        """Return what the rollers' contacts change at random in the marginal residual: columns (N, k).

        It is what invisibly small changes of the wheel speed do on the rollers beyond what they do on the
        planar plant, and the ripple of unknown initial wheel angles. Without rollers there are no columns. It
        is measured once per model.
        """
        if self._ripple is None:
            return np.zeros((self.size, 0))
        key = (self._ripple.uncertainty, model_key(model))
        if key not in self._scatter:
            nominal, columns = self._beyond_surrogate(model), []
            gain = model.effects.get("speed_gain", {}).get("gain", 1.0)
            for change in _GAIN_CHANGES:
                other = self._beyond_surrogate(model.with_effect("speed_gain", gain=gain * (1.0 + change)))
                if nominal is not None and other is not None:
                    columns.append(self.marginal(other - nominal))
            found = np.stack(columns, axis=1) / np.sqrt(len(columns)) if columns else np.zeros((self.size, 0))
            if self._ripple.uncertainty:
                found = np.concatenate([found, self._ripple.columns(model)], axis=1)
            self._scatter[key] = found
        return self._scatter[key]

    def _beyond_surrogate(self, model: Model) -> FloatArray | None:
        full, surrogate = self.residual(model), self.surrogate_residual(model)
        return None if full is None or surrogate is None else full - surrogate

    def update_angle_uncertainty(self, model: Model, residual: FloatArray) -> bool:
        """Find out from a model's marginal `residual` (N,) how unknown the initial wheel angles are.

        `roller_scatter` then counts it. Return whether they are less known than assumed so far.
        """
        return self._ripple is not None and self._ripple.update(model, residual)

    def _nuisance(self) -> FloatArray:
        surrogate = self.surrogate_residual(self.base)

        def column(model: Model) -> FloatArray | None:
            changed = self.surrogate_residual(model)
            if changed is not None and surrogate is not None and np.any(changed != surrogate):
                return surrogate - changed
            changed = self.residual(model)
            return None if changed is None else self.base_residual - changed

        columns = [c for c in self.study.map(column, plausible_models(self.base)) if c is not None]
        shapes = shape_columns(self.base, self.whitener.error, self.observations)
        columns += [self.whitener.whiten(parts) for parts in shapes]
        return np.stack(columns, axis=1) if columns else np.zeros((self.size, 0))


class WheelAngleRipple:
    """What unknown initial wheel angles change in the residual of a model.

    A log does not say at which angles its wheels started, so when each roller touches the floor is unknown,
    too. The ripple that this causes is simulated with other initial angles than those of the nominal
    simulator, recognised in the residual, and then counted as noise.
    """

    def __init__(
        self,
        simulators: Simulators,
        whitener: Whitener,
        residual: Callable[[Simulator, Model], FloatArray | None],
        marginal: Callable[[FloatArray], FloatArray],
    ) -> None:
        self._nominal, self._others, self._whitener = simulators.full, simulators.turned, whitener
        self._residual, self._marginal = residual, marginal
        self.uncertainty = 0.0
        """How unknown the initial angles are: 0 as in the simulation .. 1 entirely."""

    def update(self, model: Model, residual: FloatArray) -> bool:
        """Estimate from a residual how unknown the initial angles are; return whether it is more than before.

        Let d be the change of the residual when the wheels start at other angles. The residual of a right
        model is uncorrelated with d if the logs' angles are the simulated ones, and contains -d / 2 on
        average if they are any others. `residual` is the marginal one of the model, (N,).
        """
        ripple, rest = self._second_differences(self._changes(model)), self._second_differences(residual)
        power = float(np.sum(ripple**2))
        unknown = min(1.0, -2.0 * float(np.sum(ripple * rest[:, None])) / power) if power > 0.0 else 0.0
        if unknown < max(_ANGLE_STEP, self.uncertainty + _ANGLE_STEP):
            return False
        self.uncertainty = unknown
        return True

    def columns(self, model: Model) -> FloatArray:
        """Return what unknown angles may add to a right model's marginal residual: columns (N, k)."""
        blocks = self._nominal.observations.blocks
        repeats = np.concatenate([np.full(block.value.size, float(block.repeats)) for block in blocks])
        # Two draws differ by twice the variance of one. Measured is the mean of the repeats; simulated, one.
        variance = self.uncertainty * 0.5 * (1.0 + 1.0 / repeats) * _INFLATION
        changes = self._changes(model)
        return np.asarray(changes * np.sqrt(variance)[:, None] / math.sqrt(max(1, changes.shape[1])))

    def _changes(self, model: Model) -> FloatArray:
        """Return how the marginal residual changes when the wheels start at other angles, (N, k)."""
        nominal = self._residual(self._nominal, model)
        others = self._nominal.study.map(lambda simulator: self._residual(simulator, model), self._others)
        found = [self._marginal(one - nominal) for one in others if one is not None and nominal is not None]
        return np.stack(found, axis=1) if found else np.zeros((self._whitener.size, 0))

    def _second_differences(self, values: FloatArray) -> FloatArray:
        """Return the second differences within each block, which keep the ripple and remove slow changes."""
        return np.concatenate([np.diff(values[rows], 2, axis=0) for rows in self._whitener.slices])
