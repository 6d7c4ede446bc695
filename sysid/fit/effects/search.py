"""A set of effects beside a law: what it may grow to, both fitted again together, and what it does without.

What is fitted are the logs of a model's own fit: of a wheel on the bench, or of a robot, with its parameters.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.effects import CATALOGUE, Effect
from mecanum_env.effects.friction import COULOMB, DEAD_ZONE_LIKE_IT
from mecanum_env.effects.motor import WINDUP
from mecanum_env.errors import MecanumError
from mecanum_env.model import Model, cause_of
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.compare.least_squares import (
    SMOOTH_STEP,
    Fitted,
    ResidualProblem,
    compass_search,
    descend_steeply,
    held_starts,
    marginal_function,
)
from sysid.compare.model_error import Whitener
from sysid.compare.search_space import (
    Coordinate,
    EffectSet,
    LawWithEffects,
    RefittedLaw,
    coordinate,
    effect_set,
)
from sysid.fit.effects.candidates import TRIED, starts
from sysid.fit.effects.ceiling import HeldSpeeds, has_unasked_ceiling
from sysid.fit.effects.pi_drive import Kind, pi_drive
from sysid.fit.effects.reached import HeldOut, Reached
from sysid.fit.effects.simple_drive import SIMPLE_DRIVE, simple_drive

_FITTED: Final = 3
"""Effects by which a set is tried to grow in each round: those that promise most."""
_SHORTEST_WASHOUT_S: Final = 0.004
_SHORTEST_RISE_S: Final = 0.005
"""Bounds of what logs can show [s]: about the shortest time between rows."""
_LARGEST_GAIN: Final = 5.0
"""Largest gain of a drive beside its effects, and inverse of the smallest. Assumed."""
_SHARES: Final = (0.3, 0.1)
"""Shares of the way from neutral to the most promising place at which a fit may start again. Assumed."""
_FRICTIONS: Final = frozenset((COULOMB, "stiction"))
"""Causes that include Coulomb friction."""


@dataclass(frozen=True, eq=False)
class _Growth:
    """A set of effects with one more, not yet fitted."""

    expected: float
    """Cost that linear least squares expects."""
    place: FloatArray
    """Where it expects that, (p,)."""
    neutral: FloatArray
    """The set as it was fitted, with the further effect at neutral, (p,)."""
    candidate: LawWithEffects


class EffectSearch:
    """The effects beside one starting law, and of a robot beside some of its parameters."""

    def __init__(
        self,
        law: Model,
        whitener: Whitener,
        held_out: HeldOut,
        largest_pole: float,
        known: Mapping[str, Effect],
        robot: tuple[str, ...] = (),
        held: HeldSpeeds | None = None,
    ) -> None:
        """Search beside a `law`; `held` are the speeds of all fit runs, by default of those that decide."""
        self.known, self.robot = known, robot
        self.base = replace(law, uncertainty={})
        self.problem = ResidualProblem(self.base, whitener, held_out.settings)
        self.held_out, self.largest_pole = held_out, largest_pole
        self.held = held or HeldSpeeds.of(whitener.observations)
        values = [float(np.max(np.abs(block.value))) for block in whitener.observations.blocks]
        self._top_rpm = max(values, default=0.0)
        runs = [situation.runs[0] for situation in whitener.observations.situations]
        self._asked_rpm = max((float(np.nanmax(np.abs(run.command.wheels_rpm))) for run in runs), default=0.0)

    def begin(self) -> Reached | None:
        """Return the law fitted again by these residuals, with the effects that it came with."""
        names = [name for name in self.base.effects if name in self.known]
        law = RefittedLaw(self.base, self.robot, self.largest_pole)
        candidate = LawWithEffects(law, self._set(names))
        return self._reached(candidate, candidate.start())

    def simple_drive(self, alone: Model) -> Model:
        """Return the simple drive that explains these logs best; the rest is as in the law `alone`."""
        names = [name for name in SIMPLE_DRIVE if name in self.known]
        return simple_drive(alone, self._set(names), self.largest_pole, self.problem.cost)

    def pi_drive(self, alone: Model, kind: Kind) -> Model:
        """Return the PI drive of a `kind` that explains these logs best.

        The rest is as in the law `alone`.
        """
        return pi_drive(alone, self._top_rpm, kind, self.problem.residuals_of)

    def beside(self, reached: Reached) -> EffectSearch:
        """Return this search from the start of a set."""
        return self._from(reached.base)

    def without(self, cause: str) -> EffectSearch:
        """Return this search without the effects of a `cause`; it begins as this one does."""
        search = copy.copy(self)
        search.known = {name: effect for name, effect in self.known.items() if effect.cause != cause}
        return search

    def grown(self, reached: Reached) -> list[Reached]:
        """Return the sets with one effect more that promise most, and with one in another form, fitted."""
        promising = sorted(self._promising(reached), key=lambda growth: growth.expected)[:_FITTED]
        fitted = [self._fitted(growth, reached.fitted.cost) for growth in promising]
        # On a robot each of these trials would simulate the whole of it.
        exchanges = () if self.robot else self._exchanges(reached)
        exchange = min(exchanges, key=lambda exchange: exchange.expected, default=None)
        if exchange is not None and exchange.expected < reached.fitted.cost:
            fitted.append(exchange.search._reached(exchange.candidate, exchange.place))
        return [one for one in fitted if one is not None]

    def pruned(self, reached: Reached, tried: int | None = None) -> Reached:
        """Return the set without effects that are not worth their price, the least useful first.

        At a time so many effects are `tried`, those first that least squares expects to matter least; None:
        all.
        """
        names = sorted(reached.fitted.candidate.effects.names, key=lambda name: self._use(reached, name))
        inflation = reached.inflation
        smaller: list[tuple[Reached, EffectSearch]] = []
        for name in names[:tried] if len(names) > 1 else ():
            search = self._beside_none_of(name)
            found = search._reached(*_without(reached, name))
            if found is not None and found.price(inflation) < reached.price(inflation):
                smaller.append((found, search))
        if not smaller:
            return reached
        best, search = min(smaller, key=lambda one: one[0].price(inflation))
        return search.pruned(best, tried)

    def rubbing(self, reached: Reached) -> Reached:
        """Return the set with friction for a dead zone that subtracts, unless that explains the logs better.

        Better is what `Reached.better_than` says: by BIC, and on the validation runs.
        """
        old = reached.fitted.candidate
        names = old.effects.names
        if DEAD_ZONE_LIKE_IT not in names or {cause_of(name) for name in names} & _FRICTIONS:
            return reached
        without, place = _without(reached, DEAD_ZONE_LIKE_IT)
        torque, answer = self._set([COULOMB]).coordinates
        effects = EffectSet(
            (*without.effects.names, COULOMB),
            (*without.effects.coordinates, torque),
            # A time of answer would be one number more than the dead zone has.
            (*without.effects.fixed, (COULOMB, answer.parameter, 0.0)),
        )
        threshold_rpm = reached.model.effects[DEAD_ZONE_LIKE_IT]["threshold_rpm"]
        start = torque.unit(threshold_rpm * RAD_S_PER_RPM * self.base.robot.servo_n_m_s_rad)
        # The set may have lost effects that this search began with.
        search = self._from(reached.base)._beside_none_of(DEAD_ZONE_LIKE_IT)
        found = search._reached(LawWithEffects(old.law, effects), np.append(place, start))
        return reached if found is None or reached.better_than(found) else found

    def _beside_none_of(self, name: str) -> EffectSearch:
        """Return this search with a starting law that comes without an effect."""
        if name not in self.base.effects:
            return self
        effects = {other: values for other, values in self.base.effects.items() if other != name}
        return self._from(replace(self.base, effects=effects))

    def _from(self, start: Model) -> EffectSearch:
        """Return this search with another starting law."""
        if start is self.base:
            return self
        whitener = self.problem.whitener
        more = (self.held_out, self.largest_pole, self.known, self.robot, self.held)
        return EffectSearch(start, whitener, *more)

    def _use(self, reached: Reached, name: str) -> float:
        """Return by how much least squares expects the cost to rise without an effect."""
        fitted, bare = reached.fitted, replace(self.base, effects={})
        neutral = fitted.place.copy()
        first = fitted.candidate.law.parameter_count
        for index, one in enumerate(fitted.candidate.effects.coordinates):
            parameter = next(p for p in CATALOGUE[one.effect].parameters if p.name == one.parameter)
            if one.effect == name and parameter.neutral is not None:
                value = parameter.neutral_in(bare)
                neutral[first + index] = one.unit(value) if math.isfinite(value) else 1.0
        mine = np.array([owner == name for owner in fitted.candidate.owners])
        others = np.linalg.qr(fitted.jacobian[:, ~mine])[0]
        change = fitted.jacobian @ (neutral - fitted.place)
        return float(np.sum((change - others @ (others.T @ change)) ** 2))

    def _fitted(self, growth: _Growth, limit: float) -> Reached | None:
        """Return a growth, fitted; None if its cost does not fall below a `limit`.

        The place that promises most is that of a straight line, and beside a law that is free it may lead
        astray. The fit then starts again nearer to neutral, where the cost is least.
        """
        found = self._reached(growth.candidate, growth.place)
        if found is None or found.fitted.cost >= limit:
            function = marginal_function(self.problem, growth.candidate)

            def cost(place: FloatArray) -> float:
                residual = function(place)
                return math.inf if residual is None else float(residual @ residual)

            way = growth.place - growth.neutral
            nearer = min((growth.neutral + share * way for share in _SHARES), key=cost)
            found = self._reached(growth.candidate, nearer)
        return found if found is not None and found.fitted.cost < limit else None

    def _reached(self, candidate: LawWithEffects, place: FloatArray) -> Reached | None:
        function = marginal_function(self.problem, candidate)
        near = held_starts(self.problem, candidate, function)
        reached = descend_steeply(function, place, step=SMOOTH_STEP, near=near)
        if reached is None:
            return None
        if any(candidate.stepwise):
            looked = compass_search(function, reached, np.array(candidate.stepwise))
            reached = descend_steeply(function, looked.place, step=SMOOTH_STEP, near=near) or reached
        found = Fitted(candidate, reached.place, reached.residual, reached.jacobian)
        model = candidate.model(self.base, found.place)
        if has_unasked_ceiling(model, self._asked_rpm) or self.held.rise_beyond_ceiling(model):
            return None
        try:
            held_out = self.held_out.errors(model)
        except MecanumError:
            # Held-out commands may drive a model astray that the fit runs do not.
            return None
        return Reached(self.base, found, candidate.parameter_count, *held_out)

    def _set(self, names: Sequence[str]) -> EffectSet:
        """Return effects with free parameters whose bounds are as wide as these logs allow."""
        scale = self.problem.settings.scale
        chosen = effect_set(self.base, names, scale=scale)
        tried = [
            coordinate(self.base, CATALOGUE[name], parameter, scale)
            for name in chosen.names
            for parameter in CATALOGUE[name].parameters
            if parameter.name in TRIED
        ]
        free = dict.fromkeys([*chosen.coordinates, *tried])
        # Whether the integral of the drive winds up belongs to its law (`pi_drive`).
        return replace(chosen, coordinates=tuple(self._wide(c) for c in free if c.parameter != WINDUP.name))

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

    def _exchanges(self, reached: Reached) -> Iterator[_Exchange]:
        """Yield the set with each effect in each other form, at the best of the places where that is tried.

        Parameters that both forms have stay as they are.
        """
        values = reached.model.effects
        orthogonal = np.linalg.qr(reached.fitted.jacobian)[0]
        for name in reached.fitted.candidate.effects.names:
            search = self._beside_none_of(name)
            without, place = _without(reached, name)
            for other, effect in self.known.items():
                if other == name or effect.cause != cause_of(name):
                    continue
                added = search._set([other])
                names = (*without.effects.names, other)
                free = (*without.effects.coordinates, *added.coordinates)
                candidate = LawWithEffects(without.law, EffectSet(names, free, without.effects.fixed))
                function = marginal_function(search.problem, candidate)
                best: tuple[float, FloatArray] | None = None
                for start in starts(effect, added, self.problem.settings.scale, values[name]):
                    residual = function(np.concatenate([place, start]))
                    if residual is None:
                        continue
                    along = orthogonal.T @ residual
                    expected = float(residual @ residual - along @ along)
                    if best is None or expected < best[0]:
                        best = (expected, np.concatenate([place, start]))
                if best is not None:
                    yield _Exchange(best[0], search, candidate, best[1])

    def _promising(self, reached: Reached) -> Iterator[_Growth]:
        """Yield the growth by each further effect from where linear least squares expects most of it."""
        fitted, scale = reached.fitted, self.problem.settings.scale
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
                yield _Growth(*best, np.concatenate([fitted.place, added.start()]), candidate)


@dataclass(frozen=True, eq=False)
class _Exchange:
    """A set in which an effect has another form, not yet fitted."""

    expected: float
    """Cost that linear least squares expects."""
    search: EffectSearch
    candidate: LawWithEffects
    place: FloatArray
    """Where the other parameters are as they were, (p,)."""


def _without(reached: Reached, name: str) -> tuple[LawWithEffects, FloatArray]:
    """Return a set without one of its effects, and where it was fitted."""
    old = reached.fitted.candidate
    kept = [i for i, one in enumerate(old.effects.coordinates) if one.effect != name]
    effects = old.effects.only([other for other in old.effects.names if other != name])
    count = old.law.parameter_count
    place = np.concatenate([reached.fitted.place[:count], reached.fitted.place[count:][kept]])
    return LawWithEffects(old.law, effects), place
