"""The residual of any model on the runs of a study, whitened and marginalised over the model's own error.

The whitened residual r (N,) of the right model is normal with covariance I + X X', X the columns of
`sysid.compare.model_error.nuisance`. It is whitened again by W of `sysid.compare.model_error.marginal`: |W
r|^2 is the sum of squares that remains after the model's own error has explained what it can.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Final, TypeAlias

import numpy as np

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.apply import without_sensors
from mecanum_env.errors import MecanumError
from mecanum_env.model import Model, cause_of
from mecanum_env.simulator.free_wheel import EffectNumbers, FreeWheels
from mecanum_env.units import FloatArray
from sysid.compare.least_squares.gauss_newton import Mask
from sysid.compare.least_squares.phases import with_unknown_phases
from sysid.compare.least_squares.ripple import WheelAngleRipple
from sysid.compare.least_squares.shared_part import shared_part
from sysid.compare.model_error import (
    KNOWN,
    DifferenceCounts,
    Exchange,
    Learned,
    Marginal,
    RepeatedCommands,
    Whitener,
    plausible_models,
    shape_columns,
    step_error,
)
from sysid.compare.predicted import (
    MIDDLE,
    START_PRICE,
    Averaged,
    SimulationSettings,
    Simulator,
    Simulators,
    Starts,
    model_key,
    planar_part,
)
from sysid.compare.search_space import scale_of

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

ResidualOf: TypeAlias = Callable[[Model], FloatArray | None]
"""Model -> whitened residual (N,), None if it cannot be simulated."""


class ResidualProblem:
    """Residuals of models on some observations.

    On rollers it also has a surrogate: the planar plant, which takes a tenth of the time and is smooth. The
    error and the parameter uncertainty that the `base` model states are marginalised, as is the error of the
    planar plant's physics step. The `scale` of the settings is replaced by that of the model and the runs.
    The `simulators` of another problem of the same observations and settings remember what they simulated.
    With what was `learned` from the logs of the base model's fit, predictions are corrected by its mean, and
    its covariance is what is marginalised. Both are taken where the model `at` moves the robot, by default
    the base model.
    """

    def __init__(
        self,
        base: Model,
        whitener: Whitener,
        settings: SimulationSettings | None = None,
        simulators: Simulators | None = None,
        learned: Learned | RepeatedCommands | None = None,
        at: Model | None = None,
    ) -> None:
        self._learned = learned
        self.base, self.whitener = base, whitener
        self.observations = whitener.observations
        runs = [run for situation in self.observations.situations for run in situation.runs]
        self.settings = replace(settings or SimulationSettings(), scale=scale_of(base, runs))
        self.simulators = simulators or Simulators.of(self.observations, self.settings)
        self.bench = runs[0].level == "bench"
        self._ripple: WheelAngleRipple | None = None
        if self.simulators.planar is not None and learned is None:
            # Where the logs of the fit are known, their ripple is among the model's own error.
            self._ripple = WheelAngleRipple(self.simulators, whitener, self._residual, self.marginal)
        self.measured = whitener.whiten(whitener.measured())
        self.nuisance = np.zeros((self.size, 0))
        self.knows_all = learned is not None and not self.bench
        """Whether what every effect would do is among the model's own error, as far as the logs of its fit
        leave that open, so that only what is new counts."""
        self.same_commands = isinstance(learned, RepeatedCommands)
        """Whether the logs of the fit have the same commands, so that what the model errs by was measured."""
        self.correction = np.zeros(self.size)
        """What the logs of the fit say that the base model errs by, (N,); taken off what was measured."""
        if learned is not None:
            self.correction, self.nuisance = learned.expected_error(whitener, self.simulators, at)
            self.measured = self.measured - self.correction
        self._starts_of_base: frozenset[int] = frozenset()
        if self.bench:
            self._starts_of_base = self.simulators.full.unknown_starts(without_sensors(base))
        unchanged = self.simulators.averaged if self.knows_all else self.simulators.full
        residual = self._residual(unchanged, base)
        # The simulation that cannot be made says why.
        self.base_residual = (
            self.measured - whitener.whiten(unchanged.predictions(base)) if residual is None else residual
        )
        if learned is None:
            self.nuisance = self._nuisance()
        """X, shape (N, q)."""
        self._marginal = Marginal(self.nuisance)
        self.unchanged = np.zeros((self.size, 0))
        """Marginal residuals of bench logs in which nothing changed: what each repeat in the logs of the fit
        shows beside the others, where the same commands are driven again, (N, repeats)."""
        self.exchange: Exchange | None = None
        """New runs exchanged with those of the fit, where a wheel drives the same commands again."""
        if isinstance(learned, RepeatedCommands) and self.bench:
            self.unchanged = self.marginal(learned.of_unchanged(whitener))
            self.exchange = Exchange(whitener, learned.places, self.marginal) if learned.places else None
        self._scatter: dict[Hashable, FloatArray] = {}

    @property
    def difference_counts(self) -> DifferenceCounts:
        """How many differences of repeats tell what chance does in these logs."""
        return self._learned.difference_counts if isinstance(self._learned, RepeatedCommands) else KNOWN

    def luck(self, rng: np.random.Generator, draws: int, count: float) -> FloatArray:
        """Return factors (draws,) on what chance gains where so many differences (`count`) tell the noise.

        They are drawn with `rng`.
        """
        learned = self._learned
        return learned.luck(rng, draws, count) if isinstance(learned, RepeatedCommands) else np.ones(draws)

    def moved(self, at: Model) -> ResidualProblem:
        """Return the problem with what was learned of the base model's error, where `at` moves the robot."""
        return ResidualProblem(self.base, self.whitener, self.settings, self.simulators, self._learned, at)

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
        """Return the whitened residual (N,) of a model, None if it cannot be simulated.

        Where the logs of the fit tell how the base model errs, only what a model changes counts. It is
        simulated on the planar plant as far as that shows it, and otherwise as far as draws of the rollers'
        angles agree: rollers meet the floor by chance a little earlier or later with any change, which would
        hide most changes, or look like one.
        """
        if not self.knows_all or not self.has_surrogate:
            return self._residual(self.simulators.full, model)
        slow = self._only_on_rollers(model)
        rollers = self._on_rollers(slow)
        if rollers is None or model_key(slow) == model_key(model):
            return rollers
        here, there = self.surrogate_residual(slow), self.surrogate_residual(model)
        return None if here is None or there is None else rollers + there - here

    def residuals_of(self, model: Model, laws: FloatArray, effects: EffectNumbers) -> list[FloatArray | None]:
        """Return what `residual` does of several wheels on the bench, which are simulated at once.

        They are like that of a `model`, with other `laws` and `effects`, see `FreeWheels.of`.
        """
        wheels = FreeWheels.of(model, laws, effects, self.settings.timestep_s)
        found = self.simulators.full.predictions_of(wheels, model.wheel.command_period_s)
        return [None if one is None else self.measured - self.whitener.whiten(one) for one in found]

    def cost(self, model: Model) -> float:
        """Return the sum of squares of a model's residual, infinite if it cannot be simulated."""
        residual = self.residual(model)
        return math.inf if residual is None else float(residual @ residual)

    def _on_rollers(self, model: Model) -> FloatArray | None:
        """Return the whitened residual (N,) of a model that differs from the base model on rollers alone."""
        if model_key(model) == model_key(self.base):
            return self.base_residual
        here, there = self._drawn_base, self._drawn(model)
        if here is None or there is None:
            return None
        return self.base_residual + shared_part([b - a for a, b in zip(here, there, strict=True)])

    @cached_property
    def _drawn_base(self) -> list[FloatArray] | None:
        return self._drawn(self.base)

    def _drawn(self, model: Model) -> list[FloatArray] | None:
        """Return the whitened residual (N,) in each draw of the rollers' angles; None if one is missing."""
        found = [self._beside(one.predictions, model) for one in self.simulators.averaged.simulators]
        known = [residual for residual in found if residual is not None]
        return known if len(known) == len(found) else None

    def _only_on_rollers(self, model: Model) -> Model:
        """Return the base model with those effects of a model that the surrogate does not show."""
        slow = {name: v for name, v in model.effects.items() if not self.surrogate_covers([name])}
        causes = {cause_of(name) for name in slow}
        shown = {
            name: values
            for name, values in self.base.effects.items()
            if self.surrogate_covers([name]) and cause_of(name) not in causes
        }
        return replace(self.base, effects=shown | slow)

    def residual_near(self, at: Model) -> ResidualOf | None:
        """Return the whitened residual (N,) as a function of models that are nearly the model `at`.

        Their runs start where in the gap those of that one do, instead of looking for these places again,
        which takes several simulations. None if there is nothing to look for.
        """
        if not self.bench:
            return None
        try:
            starts = self.simulators.full.starts(at)
        except _UNUSABLE:
            return None
        if starts is None:
            return None
        return partial(self._residual, self.simulators.full, starts=starts)

    def _residual(
        self, simulator: Simulator | Averaged, model: Model, starts: Starts | None = None
    ) -> FloatArray | None:
        """Return the whitened residual (N,) of a model in a simulator; of a wheel from some `starts`."""
        if not isinstance(simulator, Simulator):
            return self._beside(simulator.predictions, model)
        if starts is None and any(CATALOGUE[name].follows_angle for name in model.effects):
            # A run starts at one place, whichever phase is tried: the phases differ by their waves alone.
            try:
                starts = simulator.starts(model)
            except _UNUSABLE:
                return None
        residual = self._beside(partial(simulator.predictions, starts=starts), model)
        if residual is None:
            return None
        # What the unknown starts cost is spread over the residual as a factor, as that of unknown phases is.
        # Those that the base model leaves open, too, are no news.
        unknown = simulator.unknown_starts(without_sensors(model)) - self._starts_of_base
        for block, part in zip(self.observations.blocks, self.whitener.slices, strict=True):
            square = float(residual[part] @ residual[part])
            if block.situation in unknown and square > 0.0:
                residual[part] *= math.sqrt(1.0 + START_PRICE / square)
        return residual

    def _from_middle(self, model: Model) -> FloatArray | None:
        """Return the whitened residual (N,) of a wheel that starts in the middle of its gap in each run."""
        return self._beside(partial(self.simulators.full.predictions, starts=MIDDLE), model)

    def _beside(
        self, predictions: Callable[[Model], Sequence[FloatArray]], model: Model
    ) -> FloatArray | None:
        """Return the whitened residual (N,) of a model beside its predictions; None if there are none."""

        def predictions_of(one: Model) -> Sequence[FloatArray] | None:
            try:
                return predictions(one)
            except _UNUSABLE:
                return None

        blocks, whitener = self.observations.blocks, self.whitener
        return with_unknown_phases(
            predictions_of, whitener.whiten, self.measured, model, blocks, whitener.slices
        )

    def surrogate_residual(self, model: Model) -> FloatArray | None:
        """Return the whitened residual (N,) of a model on the planar plant; on the bench that of `residual`.

        Only its differences are meaningful. Without slip and without the effects that the plant refuses they
        agree with those of the rollers to some per cent.
        """
        if self.simulators.planar is None:
            return self.residual(model)
        return self._residual(self.simulators.planar, planar_part(model))

    def surrogate_covers(self, effects: Sequence[str]) -> bool:
        """Return whether there is a surrogate and it shows what the `effects` change.

        Beside the logs of the fit it need only show most of it: what rollers add is less than what they do by
        chance, and less than what the model errs by.
        """
        known = [CATALOGUE[name] for name in effects if name]
        shown = (effect.acts_in if self.knows_all else effect.fully_in for effect in known)
        return self.simulators.planar is not None and all(shows("planar") for shows in shown)

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

        It is None for a model that cannot be simulated. A `surrogate` is simulated by `surrogate_residual`.
        Wheels on the bench start in the middle of their gap: what a model changes must not follow the noise
        of the very runs beside which it is asked what chance does, and what differs from run to run.
        """
        simulated = self.surrogate_residual if surrogate else self.residual
        simulated = self._from_middle if self.bench else simulated
        unchanged = simulated(reference) if models else None

        def change(model: Model) -> FloatArray | None:
            changed = simulated(model)
            return None if changed is None or unchanged is None else self.marginal(changed - unchanged)

        return self.settings.map(change, models)

    def marginal(self, residual: FloatArray) -> FloatArray:
        """Return W times a residual (N,) or columns (N, p)."""
        return self._marginal.of(residual)

    def marginal_inverse(self, residual: FloatArray) -> FloatArray:
        """Return W^-1 times a residual (N,) or columns (N, p)."""
        return self._marginal.inverse(residual)

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

        columns = [c for c in self.settings.map(column, plausible_models(self.base)) if c is not None]
        shapes = shape_columns(self.base, self.whitener.error, self.observations)
        columns += [self.whitener.whiten(parts) for parts in shapes]
        try:
            step = step_error(self.base, self.observations, self.settings)
        except _UNUSABLE:
            step = None
        columns += [] if step is None else [self.whitener.whiten(step)]
        return np.stack(columns, axis=1) if columns else np.zeros((self.size, 0))
