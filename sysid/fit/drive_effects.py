"""What a drive does besides its law, found while the law is fitted: friction, a dead zone, limits, a gain.

The law alone is the model as long as it is enough. An effect is added, and law and effects are fitted again
together, only if three things hold: the cost falls by more than `EVIDENCE` beyond the price of its parameters
(BIC), the validation runs are predicted better by `WORTH`, and no smaller set does as well. The noise is that
of repeats; where the model leaves more than the noise, the residual's variance is used instead.

A law of unit DC gain fits a drive that never reaches its command by a pole that never settles. Two laws are
therefore starting points: that of the fit, and one with a free gain, which becomes the effect `speed_gain`. A
pole slower than the logs can show only imitates a gain, and errs as soon as a command is held longer: if the
law of the fit has one, first-order laws with a free gain are the starts, and no pole may become that slow.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.effects import CATALOGUE, Effect, Parameter
from mecanum_env.errors import MecanumError
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.law.stability import POLE_LIMIT
from mecanum_env.model import Model, cause_of
from mecanum_env.statistics import rms
from mecanum_env.units import FloatArray
from sysid.compare.coordinates import EffectSet, coordinate, effect_set, scanned
from sysid.compare.fitted import Fitted, RefittedLaw, fit, marginal_function
from sysid.compare.joint import LawWithEffects, joint_covariance
from sysid.compare.noise import measure_noise
from sysid.compare.observations import Observations, observe
from sysid.compare.prediction import Study
from sysid.compare.problem import ResidualProblem
from sysid.compare.simulator import Simulator
from sysid.compare.subset import select_runs
from sysid.compare.whitening import Whitener
from sysid.logs import Dataset
from sysid.progress import Progress, silent

EVIDENCE: Final = 10.0
"""Difference of BIC that an effect must gain: "very strong" on the scale of Kass and Raftery (1995)."""
WORTH: Final = 0.02
"""Least relative decrease of the error on the validation runs for which an effect is added. Assumed; the same
as for a delay or a ceiling (`drive_choice`)."""
_MOST: Final = 4
"""Largest number of effects. Assumed."""
_FITTED: Final = 4
"""Effects that are fitted together with the law in each round: those that promise most."""
_SECONDS: Final = 120.0
"""Duration of the runs that decide, repeats not counted [s]."""
_STATIONS: Final = ("set_point", "law", "load", "transmission")
"""Where a drive departs from its law; a sensor's effects are the same to one wheel, or the law's own."""
_OVER_TIME: Final = ("battery_sag", "warm_up")
"""Causes that change during a run, which is no property of a drive."""
_PROBES: Final = (0.03, 0.15, 0.5)
"""Steps from neutral at which a parameter without a scan is tried, on its scale from 0 to 1."""
_NORMAL_90: Final = 1.645
_TIME_CONSTANTS: Final = (0.02, 0.06, 0.2, 0.5)
"""Time constants of first-order laws to start from, relative to the largest one allowed."""


@dataclass(frozen=True, eq=False)
class DriveEffects:
    """Law and effects that were fitted together."""

    model: Model
    """The model with the law and the effects."""
    covariance: FloatArray
    """Of the law's coefficients, shape (6, 6)."""
    before_rpm: float
    """Rms error of the law alone on the validation runs (the fit runs if there are none) [rpm]."""
    after_rpm: float
    """The same with the effects."""

    @property
    def note(self) -> str:
        """What was found, in a sentence."""
        found = "; ".join(
            f"{name} " + ", ".join(f"{key} {value:.4g}" for key, value in values.items())
            for name, values in self.model.effects.items()
        )
        return (
            f"the drive is not the law alone: {found}; fitted together with the law, they lower the held-out "
            f"error from {self.before_rpm:.3g} to {self.after_rpm:.3g} rpm"
        )


def find_drive_effects(
    dataset: Dataset,
    alone: Model,
    others: Sequence[Model] = (),
    largest_pole: float = POLE_LIMIT,
    progress: Progress = silent,
) -> DriveEffects | None:
    """Return the law with the effects that bench logs show, None if the law alone is enough.

    Searches start from the law that was fitted `alone`, unless a pole of it exceeds `largest_pole`, and from
    `others`. `progress` is called before each round.
    """
    runs = select_runs(dataset.split("fit"), _SECONDS, alone.wheel.command_period_s)
    observations = observe(replace(dataset, runs=runs))
    whitener = Whitener(observations, measure_noise(dataset, observations), None)
    held_out = observe(replace(dataset, runs=dataset.split("validation") or dataset.split("fit")))
    is_enough = float(np.max(np.abs(alone.wheel.law.poles))) < largest_pole
    laws = (alone, *others) if is_enough else tuple(_first_order(alone, largest_pole))
    searches = [_Search(law, whitener, held_out, largest_pole) for law in laws]
    began = [search.begin() for search in searches]
    if not is_enough:
        # The starts differ in nothing but the time constant.
        reached = [start for start in began if start is not None]
        simplest = min(reached, key=lambda start: start.fitted.cost, default=None)
        searches, began = [searches[began.index(simplest)]], [simplest]
    first = began[0]
    if first is None:
        return None
    best = first
    for search, start in zip(searches, began, strict=True):
        if start is None:
            continue
        reached_now = start if start is first or start.better_than(first) else None
        for size in range(_MOST):
            progress(f"drive effects: {size + 1}")
            grown = search.grown(reached_now or start)
            if grown is None:
                break
            reached_now = grown
        if reached_now is not None and reached_now is not best and reached_now.better_than(best):
            best = reached_now
    if not best.model.effects or (best is first and is_enough):
        return None
    before = _rms(held_out, alone)
    names, covariance = joint_covariance(best.fitted, best.base, best.inflation)
    of_law = covariance[: len(COEFFICIENTS), : len(COEFFICIENTS)]
    stated = {
        "wheel": {"names": list(COEFFICIENTS), "covariance": of_law.tolist()},
        "effects": best.intervals(),
        "joint": {"names": names, "covariance": covariance.tolist()},
    }
    model = replace(best.model, uncertainty={**best.model.uncertainty, **stated})
    return DriveEffects(model, of_law, before, best.held_out_rpm)


@dataclass(frozen=True, eq=False)
class _Reached:
    """Law and effects after a round."""

    base: Model
    fitted: Fitted[LawWithEffects]
    parameter_count: int
    """All parameters that were fitted to these logs, the gain of the starting law included."""
    held_out_rpm: float

    @property
    def model(self) -> Model:
        return self.fitted.candidate.model(self.base, self.fitted.place)

    @property
    def inflation(self) -> float:
        return max(1.0, self.fitted.cost / self.fitted.residual.size)

    def better_than(self, other: _Reached) -> bool:
        """Return whether this is worth its parameters: by BIC, and on the validation runs."""
        samples = self.fitted.residual.size
        gain = (other.fitted.cost - self.fitted.cost) / self.inflation
        price = (self.parameter_count - other.parameter_count) * math.log(samples)
        agrees = self.held_out_rpm < (1.0 - WORTH) * other.held_out_rpm
        return gain - price > EVIDENCE and agrees

    def intervals(self) -> dict[str, dict[str, dict[str, float]]]:
        """Return effect -> parameter -> value and 90 % interval, as a model file states them."""
        effects, count = self.fitted.candidate.effects, self.fitted.candidate.law.parameter_count
        spread = np.sqrt(np.diag(self.fitted.covariance(self.inflation)))[count:] * _NORMAL_90
        found: dict[str, dict[str, dict[str, float]]] = {}
        for one, place, half in zip(effects.coordinates, self.fitted.place[count:], spread, strict=True):
            ends = [one.value(float(np.clip(at, 0.0, 1.0))) for at in (place, place - half, place + half)]
            if one.effect and all(map(math.isfinite, ends)):
                values = dict(zip(("value", "low", "high"), ends, strict=True))
                found.setdefault(one.effect, {})[one.parameter] = values
        return found


class _Search:
    """The effects beside one starting law."""

    def __init__(self, law: Model, whitener: Whitener, held_out: Observations, largest_pole: float) -> None:
        self.base = replace(law, uncertainty={})
        self.problem = ResidualProblem(self.base, whitener, Study())
        self.held_out, self.largest_pole = held_out, largest_pole

    def begin(self) -> _Reached | None:
        """Return the law fitted again by these residuals, with the effects that it came with."""
        names = [name for name in self.base.effects if name in _known()]
        scale = self.problem.study.scale
        law = RefittedLaw(self.base, largest_pole=self.largest_pole)
        candidate = LawWithEffects(law, effect_set(self.base, names, scale=scale))
        return self._reached(candidate, candidate.start())

    def grown(self, reached: _Reached) -> _Reached | None:
        """Return the best set with one effect more that is worth having; None if there is none."""
        promising = sorted(self._promising(reached), key=lambda item: item[0])[:_FITTED]
        fitted = (self._reached(candidate, place) for _, candidate, place in promising)
        worthy = [one for one in fitted if one is not None and one.better_than(reached)]
        return min(worthy, key=lambda one: one.fitted.cost) if worthy else None

    def _reached(self, candidate: LawWithEffects, place: FloatArray) -> _Reached | None:
        found = fit(self.problem, candidate, place, most=20)
        if found is None:
            return None
        model = candidate.model(self.base, found.place)
        try:
            held_out_rpm = _rms(self.held_out, model)
        except MecanumError:
            # Held-out commands may drive a model astray that the fit runs do not.
            return None
        return _Reached(self.base, found, candidate.parameter_count, held_out_rpm)

    def _promising(self, reached: _Reached) -> Iterator[tuple[float, LawWithEffects, FloatArray]]:
        """Yield for each further effect the cost that linear least squares expects, and where to start."""
        fitted, scale = reached.fitted, self.problem.study.scale
        orthogonal = np.linalg.qr(fitted.jacobian)[0]
        rest = fitted.residual - orthogonal @ (orthogonal.T @ fitted.residual)
        present = {cause_of(name) for name in fitted.names}
        for name, effect in _known().items():
            if effect.cause in present:
                continue
            added = effect_set(self.base, [name], scale=scale)
            effects = EffectSet(
                (*fitted.candidate.effects.names, name),
                (*fitted.candidate.effects.coordinates, *added.coordinates),
            )
            candidate = LawWithEffects(fitted.candidate.law, effects)
            function = marginal_function(self.problem, candidate)
            best: tuple[float, FloatArray] | None = None
            for start in _starts(self.base, effect, added, scale):
                place = np.concatenate([fitted.place, start])
                residual = function(place)
                if residual is None:
                    continue
                change = residual - fitted.residual
                change = change - orthogonal @ (orthogonal.T @ change)
                square = float(change @ change)
                share = float(np.clip(-(change @ rest) / square, 0.0, 1.2)) if square > 0.0 else 0.0
                expected = float(np.sum((rest + share * change) ** 2))
                if share > 0.0 and (best is None or expected < best[0]):
                    best = (expected, place)
            if best is not None:
                yield best[0], candidate, best[1]


def _first_order(model: Model, largest_pole: float) -> Iterator[Model]:
    """Yield a model with first-order laws of unit gain and a free gain, fast ones first."""
    for share in _TIME_CONSTANTS:
        pole = float(largest_pole ** (1.0 / share))
        law = replace(model.wheel.law, A=pole, B=0.0, C=0.0, D=1.0 - pole, E=0.0, F=0.0)
        start = replace(model, wheel=replace(model.wheel, law=law))
        yield start.with_effect("speed_gain", gain=1.0)


def _starts(base: Model, effect: Effect, added: EffectSet, scale: float) -> Iterator[FloatArray]:
    """Yield the places at which one effect is tried, one parameter off neutral at a time."""
    parameters: Mapping[str, Parameter] = {p.name: p for p in effect.parameters}
    for index, one in enumerate(added.coordinates):
        parameter = parameters[one.parameter]
        if parameter.neutral is None:
            continue
        places = scanned(parameter, coordinate(base, effect, parameter, scale), scale)
        if not places:
            around = one.neutral_place
            both = [around + sign * probe for probe in _PROBES for sign in (1.0, -1.0)]
            places = [place for place in both if 0.0 <= place <= 1.0]
        for place in places:
            start = added.start()
            start[index] = place
            yield start


def _known() -> dict[str, Effect]:
    """Return the effects that a drive may have by itself, in the order of the chain."""
    return {
        name: effect
        for name, effect in CATALOGUE.items()
        if effect.acts_in("bench")
        and effect.station in _STATIONS
        and effect.cause not in _OVER_TIME
        and getattr(effect, "searched", True)
    }


def _rms(observations: Observations, model: Model) -> float:
    """Return the rms error of a model in rpm, over the means of repeats."""
    predicted = Simulator(observations).predictions(model)
    parts = [block.value - p for block, p in zip(observations.blocks, predicted, strict=True)]
    return rms(np.concatenate(parts))
