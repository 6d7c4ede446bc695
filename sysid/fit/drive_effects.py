"""What a drive does besides its law, found while the law is fitted: friction, a dead zone, limits, a gain.

The law alone is the model as long as it is enough. An effect is added, and law and effects are fitted again
together, only if three things hold: the cost falls by more than `EVIDENCE` beyond the price of its parameters
(BIC), the validation runs are predicted better by `WORTH`, and no smaller set does as well
(`sysid.fit.drive_reached`). The noise is that of repeats; where the model leaves more than the noise, the
residual's variance is used instead.

A law of unit DC gain fits a drive that never reaches its command by a pole that never settles. Two laws are
therefore starting points: that of the fit, and one with a free gain, which becomes the effect `speed_gain`. A
pole slower than the logs can show only imitates a gain, and errs as soon as a command is held longer: if the
law of the fit has one, first-order laws with a free gain are the starts, and no pole may become that slow.
Where the law leaves much more than the noise, a simple drive is a start, too (`sysid.fit.drive_global`).

A dead zone that subtracts and friction on a drive without integral action take the same speed from a wheel
that turns, and differ only while it starts and stops. Where the logs do not tell them apart, it is friction:
every motor has some. A later study of the same motor then does not take its friction for news.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.effects import CATALOGUE, Effect
from mecanum_env.effects.friction import TORQUES, droop_rpm, stiffness_is_known
from mecanum_env.errors import MecanumError
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.law.stability import POLE_LIMIT
from mecanum_env.model import Model, cause_of
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.compare.coordinates import Coordinate, EffectSet, coordinate, effect_set
from sysid.compare.descent import compass_search, descend_steeply
from sysid.compare.fitted import Fitted, RefittedLaw, marginal_function
from sysid.compare.joint import LawWithEffects, joint_covariance
from sysid.compare.noise import measure_noise
from sysid.compare.observations import observe
from sysid.compare.prediction import Study
from sysid.compare.problem import SMOOTH_STEP, ResidualProblem
from sysid.compare.subset import select_runs
from sysid.compare.whitening import Whitener
from sysid.fit.drive_candidates import TRIED, drive_candidates, first_order_laws, starts
from sysid.fit.drive_global import SIMPLE_DRIVE, simple_drive
from sysid.fit.drive_reached import EVIDENCE, HeldOut, Reached
from sysid.logs import Dataset
from sysid.progress import Progress, silent, within

_MOST: Final = 6
"""Largest number of effects. Assumed."""
_FITTED: Final = 3
"""Effects by which a set is tried to grow in each round: those that promise most."""
_BEAM: Final = 2
"""Sets that grow in each round. More than one, as two effects may explain what neither does alone."""
_PATIENCE: Final = 2
"""Rounds without a better set after which the search ends: the second of a pair may be what helps."""
_SHORTEST_WASHOUT_S: Final = 0.004
_SHORTEST_RISE_S: Final = 0.005
"""Bounds of what logs can show [s]: about the shortest time between rows."""
_FAR: Final = 2.0
"""Squared error of the law over the noise from which a simple drive, fitted globally, is a start, too.
Assumed."""
_SECONDS: Final = 40.0
_TICKS: Final = 8000
"""Longest duration of the runs that decide, repeats not counted [s], and most ticks of the law in them."""
_LARGEST_GAIN: Final = 5.0
"""Largest gain of a drive beside its effects, and inverse of the smallest. Assumed."""
_SUBTRACTING: Final = "command_deadband/subtract"
_FRICTION: Final = "coulomb_friction"
_FRICTIONS: Final = frozenset(("coulomb_friction", "stiction"))
"""A dead zone that subtracts, what looks the same while the wheel turns, and causes that include it."""


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
            f"{name} " + ", ".join(f"{key} {value:.4g}" for key, value in self._sizes(name).items())
            for name in self.model.effects
        )
        return (
            f"the drive is not the law alone: {found}; fitted together with the law, they change the "
            f"held-out error from {self.before_rpm:.3g} to {self.after_rpm:.3g} rpm"
        )

    def _sizes(self, name: str) -> dict[str, float]:
        """Return the parameters of an effect; a torque as the speed that it takes, in N m only if known."""
        values, torque = dict(self.model.effects[name]), TORQUES.get(cause_of(name), "")
        if torque not in values:
            return values
        told = {"droop_rpm": droop_rpm(name, values, self.model)}
        if not stiffness_is_known(self.model):
            del values[torque]
        return told | values


def find_drive_effects(
    dataset: Dataset,
    alone: Model,
    others: Sequence[Model] = (),
    largest_pole: float = POLE_LIMIT,
    progress: Progress = silent,
) -> DriveEffects | None:
    """Return the law with the effects that bench logs show, None if the law alone is enough.

    Searches start from the law that was fitted `alone`, unless a pole of it exceeds `largest_pole`, and from
    `others`. `progress` is called before the search, and before each round of it.
    """
    progress(stage := "drive effects")
    tell = within(progress, stage)
    seconds = min(_SECONDS, _TICKS * alone.wheel.law.sample_period_s)
    runs = select_runs(dataset.split("fit"), seconds, alone.wheel.command_period_s)
    observations = observe(replace(dataset, runs=runs))
    whitener = Whitener(observations, measure_noise(dataset, observations), None)
    held_out = HeldOut.of(dataset)
    is_enough = float(np.max(np.abs(alone.wheel.law.poles))) < largest_pole
    laws = (alone, *others) if is_enough else tuple(first_order_laws(alone, largest_pole))
    known = drive_candidates(dataset.columns)
    searches = [_Search(law, whitener, held_out, largest_pole, known) for law in laws]
    began = [start for search in searches if (start := search.begin()) is not None]
    if not began or (is_enough and began[0].base is not searches[0].base):
        return None
    if not is_enough:
        # The starts differ in nothing but the time constant.
        began = [min(began, key=lambda start: start.fitted.cost)]
        searches = [search for search in searches if search.base is began[0].base]
    first = began[0]
    if first.inflation > _FAR:
        tell("a simple drive, from anywhere")
        searches.append(_Search(searches[0].simple_drive(alone), whitener, held_out, largest_pole, known))
        simple = searches[-1].begin()
        began += [] if simple is None else [simple]
    reached = _searched(searches, began, tell)
    if first.inflation <= _FAR:
        # Where the law leaves little, only the set with the best price may take its place, and if held-out
        # runs refuse that, the law stays. Smaller sets may pass: the supply limit of the bundled logs would.
        reached = reached[:1]
    worthy = next((one for one in reached if one is not first and one.better_than(first)), None)
    if worthy is None and is_enough:
        return None
    best = worthy or first
    before_rpm = held_out.errors(alone)[1]
    names, covariance = joint_covariance(best.fitted, best.base, best.inflation)
    of_law = covariance[: len(COEFFICIENTS), : len(COEFFICIENTS)]
    stated = {
        "wheel": {"names": list(COEFFICIENTS), "covariance": of_law.tolist()},
        "effects": best.intervals(),
        "joint": {"names": names, "covariance": covariance.tolist()},
    }
    model = replace(best.model, uncertainty={**best.model.uncertainty, **stated})
    return DriveEffects(model, of_law, before_rpm, best.held_out_rpm)


def _searched(searches: Sequence[_Search], began: Sequence[Reached], tell: Progress) -> list[Reached]:
    """Return the sets of effects that were the best ones while they grew from starts, the last one first.

    Each start belongs to one of the searches.
    """
    beam, best, stale = list(began), began[0], 0
    bests = [best]
    for size in range(_MOST):
        tell(f"effect {size + 1}")
        before, best = best, min([best, *beam], key=lambda one: one.price(best.inflation))
        stale = 0 if size == 0 or best is not before else stale + 1
        bests += [best] if best is not before else []
        if stale == _PATIENCE:
            break
        grown = [
            more
            for search in searches
            for one in beam
            if one.base is search.base
            for more in search.grown(one)
        ]
        beam = _best_ones(grown, best.inflation)
        if not beam:
            break
    best = min([best, *beam], key=lambda one: one.price(best.inflation))
    search = next(search for search in searches if search.base is best.base)
    pruned = search.pruned(best)
    return list(dict.fromkeys([search.rubbing(pruned), pruned, best, *reversed(bests)]))


class _Search:
    """The effects beside one starting law."""

    def __init__(
        self,
        law: Model,
        whitener: Whitener,
        held_out: HeldOut,
        largest_pole: float,
        known: Mapping[str, Effect],
    ) -> None:
        self.known = known
        self.base = replace(law, uncertainty={})
        self.problem = ResidualProblem(self.base, whitener, Study())
        self.held_out, self.largest_pole = held_out, largest_pole
        values = [float(np.max(np.abs(block.value))) for block in whitener.observations.blocks]
        self._top_rpm = max(values, default=0.0)

    def begin(self) -> Reached | None:
        """Return the law fitted again by these residuals, with the effects that it came with."""
        names = [name for name in self.base.effects if name in self.known]
        law = RefittedLaw(self.base, largest_pole=self.largest_pole)
        candidate = LawWithEffects(law, self._set(names))
        return self._reached(candidate, candidate.start())

    def simple_drive(self, alone: Model) -> Model:
        """Return the simple drive that explains these logs best; the rest is as in the law `alone`."""

        def cost(model: Model) -> float:
            residual = self.problem.residual(model)
            return math.inf if residual is None else float(residual @ residual)

        names = [name for name in SIMPLE_DRIVE if name in self.known]
        return simple_drive(alone, self._set(names), self.largest_pole, cost)

    def grown(self, reached: Reached) -> list[Reached]:
        """Return the sets with one effect more that promise most, fitted."""
        promising = sorted(self._promising(reached), key=lambda item: item[0])[:_FITTED]
        fitted = (self._reached(candidate, place) for _, candidate, place in promising)
        return [one for one in fitted if one is not None]

    def pruned(self, reached: Reached) -> Reached:
        """Return the set without effects that are not worth their price, the least useful first."""
        names = reached.fitted.candidate.effects.names
        inflation = reached.inflation
        smaller = []
        for name in names if len(names) > 1 else ():
            candidate, place = _without(reached, name)
            found = self._reached(candidate, place)
            if found is not None and found.price(inflation) < reached.price(inflation):
                smaller.append(found)
        return self.pruned(min(smaller, key=lambda one: one.price(inflation))) if smaller else reached

    def rubbing(self, reached: Reached) -> Reached:
        """Return the set with friction for a dead zone that subtracts, unless that explains the logs better.

        Better is a gain of more than `EVIDENCE` in BIC, at which the logs tell the two apart.
        """
        old = reached.fitted.candidate
        names = old.effects.names
        if _SUBTRACTING not in names or {cause_of(name) for name in names} & _FRICTIONS:
            return reached
        without, place = _without(reached, _SUBTRACTING)
        torque, answer = self._set([_FRICTION]).coordinates
        effects = EffectSet(
            (*without.effects.names, _FRICTION),
            (*without.effects.coordinates, torque),
            # A time of answer would be one number more than the dead zone has.
            (*without.effects.fixed, (_FRICTION, answer.parameter, 0.0)),
        )
        threshold_rpm = reached.model.effects[_SUBTRACTING]["threshold_rpm"]
        start = torque.unit(threshold_rpm * RAD_S_PER_RPM * self.base.robot.servo_n_m_s_rad)
        found = self._reached(LawWithEffects(old.law, effects), np.append(place, start))
        if found is None or found.price(reached.inflation) > reached.price(reached.inflation) + EVIDENCE:
            return reached
        return found

    def _reached(self, candidate: LawWithEffects, place: FloatArray) -> Reached | None:
        function = marginal_function(self.problem, candidate)
        reached = descend_steeply(function, place, step=SMOOTH_STEP)
        if reached is None:
            return None
        if any(candidate.stepwise):
            looked = compass_search(function, reached, np.array(candidate.stepwise))
            reached = descend_steeply(function, looked.place, step=SMOOTH_STEP) or reached
        found = Fitted(candidate, reached.place, reached.residual, reached.jacobian)
        model = candidate.model(self.base, found.place)
        try:
            held_out = self.held_out.errors(model)
        except MecanumError:
            # Held-out commands may drive a model astray that the fit runs do not.
            return None
        return Reached(self.base, found, candidate.parameter_count, *held_out)

    def _set(self, names: Sequence[str]) -> EffectSet:
        """Return effects with free parameters whose bounds are as wide as these logs allow."""
        scale = self.problem.study.scale
        chosen = effect_set(self.base, names, scale=scale)
        tried = [
            coordinate(self.base, CATALOGUE[name], parameter, scale)
            for name in chosen.names
            for parameter in CATALOGUE[name].parameters
            if parameter.name in TRIED
        ]
        free = dict.fromkeys([*chosen.coordinates, *tried])
        return replace(chosen, coordinates=tuple(map(self._wide, free)))

    def _wide(self, one: Coordinate) -> Coordinate:
        """Return a coordinate that reaches as far as the speeds of the logs do."""
        if one.parameter == "washout_s":
            return replace(one, low=min(one.low, _SHORTEST_WASHOUT_S))
        if one.effect == "speed_gain":
            # Units of commands may be any, and a dead zone makes the gain beside it larger.
            return replace(one, low=min(one.low, 1.0 / _LARGEST_GAIN), high=max(one.high, _LARGEST_GAIN))
        if one.parameter in ("limit_rpm_s", "brake_rpm_s"):
            return replace(one, high=max(one.high, self._top_rpm / _SHORTEST_RISE_S))
        return one

    def _promising(self, reached: Reached) -> Iterator[tuple[float, LawWithEffects, FloatArray]]:
        """Yield for each further effect the cost that linear least squares expects, and where to start."""
        fitted, scale = reached.fitted, self.problem.study.scale
        orthogonal = np.linalg.qr(fitted.jacobian)[0]
        rest = fitted.residual - orthogonal @ (orthogonal.T @ fitted.residual)
        present = {cause_of(name) for name in fitted.names}
        for name, effect in self.known.items():
            if effect.cause in present:
                continue
            added = self._set([name])
            so_far = fitted.candidate.effects
            effects = EffectSet(
                (*so_far.names, name), (*so_far.coordinates, *added.coordinates), so_far.fixed
            )
            candidate = LawWithEffects(fitted.candidate.law, effects)
            function = marginal_function(self.problem, candidate)
            best: tuple[float, FloatArray] | None = None
            for start in starts(effect, added, scale):
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


def _best_ones(grown: Sequence[Reached], inflation: float) -> list[Reached]:
    """Return the best of some sets, each set of effects once."""
    found: dict[tuple[str, ...], Reached] = {}
    for one in sorted(grown, key=lambda one: one.price(inflation)):
        found.setdefault(tuple(sorted(one.fitted.candidate.effects.names)), one)
    return list(found.values())[:_BEAM]


def _without(reached: Reached, name: str) -> tuple[LawWithEffects, FloatArray]:
    """Return a set without one of its effects, and where it was fitted."""
    old = reached.fitted.candidate
    kept = [i for i, one in enumerate(old.effects.coordinates) if one.effect != name]
    effects = old.effects.only([other for other in old.effects.names if other != name])
    count = old.law.parameter_count
    place = np.concatenate([reached.fitted.place[:count], reached.fitted.place[count:][kept]])
    return LawWithEffects(old.law, effects), place
