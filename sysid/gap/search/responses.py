"""What each effect by itself does to these very logs: its response at one or several sizes.

What one more effect would do for a fitted set, by linear least squares: tells what to simulate.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import lsq_linear

from mecanum_env.effects import CATALOGUE, Effect
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.fitted import Fitted
from sysid.compare.problem import ResidualProblem
from sysid.gap.search.coordinates import (
    Coordinate,
    EffectSet,
    coordinate,
    effect_set,
    integral_action,
    joined,
    scanned,
)

_TORQUES: Final = (0.05, 0.2, 0.5)
"""Of friction on a drive with integral action, on the scale 0 .. 1."""
_TYPICAL_INTEGRAL: Final = 50.0
"""At which friction on a drive with integral action is tried first [N m/rad]."""


@dataclass(frozen=True, eq=False)
class Response:
    """The change of the marginal residual that one effect makes."""

    chosen: EffectSet
    """The effect, with the coordinates that were moved."""
    place: FloatArray
    """(p,)"""
    change: FloatArray
    """Residual there less that of the base model, marginalised, (N,)."""
    linear: bool
    """From a small step: its multiples mean something, the other way too where neutral is inside."""
    size: float
    """Along the first coordinate, how far from neutral (0 .. 1)."""


def responses(problem: ResidualProblem, effects: Sequence[str], at: Model | None = None) -> list[Response]:
    """Return the responses of effects, in the order of the catalogue; what cannot be simulated is left out.

    Args:
        problem: the model and the logs.
        effects: names in the catalogue.
        at: the model that has none of them yet; the base model when None.
    """
    found = []
    start = problem.base if at is None else at
    for name in [name for name in CATALOGUE if name in effects]:
        trials = _trials(problem.base, CATALOGUE[name], problem.probe_step([name]), problem.study.scale)
        models = [chosen.model(start, place) for chosen, place, _, _ in trials]
        for (chosen, place, linear, size), change in zip(
            trials,
            problem.changes(models, surrogate=problem.surrogate_covers([name]), reference=start),
            strict=True,
        ):
            if change is not None:
                found.append(Response(chosen, place, change, linear, size))
    return found


def _trials(
    base: Model, effect: Effect, step: float, scale: float
) -> list[tuple[EffectSet, FloatArray, bool, float]]:
    """Return set, place, whether a small step, and how far from neutral, of each simulation to make."""
    trials = []
    primary = [p for p in effect.parameters if p.simulated and p.neutral is not None]
    secondary = [p for p in effect.parameters if p.simulated and p.neutral is None and p.scan]
    for parameter in primary:
        one = coordinate(base, effect, parameter, scale)
        neutral = one.unit(one.neutral) if np.isfinite(one.neutral) else 1.0
        places = scanned(parameter, one, scale)
        linear = not places
        if linear:
            # Into the side with more room: a servo can be far weaker than the model's, and hardly stiffer.
            places = [neutral + step if neutral <= 0.5 + 1e-9 else neutral - step]
        for place in places:
            if abs(place - neutral) < 1e-9:
                continue
            moved, where = [one], [place]
            if not secondary:
                trials.append((_set(effect, moved), np.array(where), linear, abs(place - neutral)))
            for other in secondary:
                second = coordinate(base, effect, other, scale)
                for beside in scanned(other, second, scale):
                    both = np.array([place, beside])
                    trials.append((_set(effect, [one, second]), both, linear, abs(place - neutral)))
    if effect.depends_on_integral:
        trials += _with_integral(base, effect, scale)
    return trials


def _with_integral(
    base: Model, effect: Effect, scale: float
) -> list[tuple[EffectSet, FloatArray, bool, float]]:
    """Return a friction's trials on a drive with integral action, or, where it has, almost without."""
    extra = integral_action(base)
    parameter = effect.parameters[0]
    one = coordinate(base, effect, parameter, scale)
    places = scanned(parameter, one, scale) or [one.unit(one.neutral) + x for x in _TORQUES]
    action = 0.0 if extra.neutral > 0.0 else extra.unit(_TYPICAL_INTEGRAL)
    chosen = EffectSet((effect.name,), (one, extra), integral=True)
    return [(chosen, np.array([place, action]), False, place) for place in places if place <= 1.0]


def _set(effect: Effect, coordinates: list[Coordinate]) -> EffectSet:
    return EffectSet((effect.name,), tuple(coordinates))


_MOST_OF_A_RESPONSE: Final = 1.2
"""A response to a threshold is not proportional to its size: at most this multiple of it counts."""
_SEEN: Final = 0.3
"""A parameter whose response is smaller than this (in sigmas, over all samples) is left alone."""

Key = tuple[tuple[str, ...], bool]
"""Names of the effects, and whether with integral action."""


@dataclass(frozen=True, eq=False)
class Growth:
    """A set that may be fitted."""

    candidate: EffectSet
    place: FloatArray
    """Where to start."""
    parent: Fitted[EffectSet]
    """What it grew from."""
    expected: float
    """Square sum, by linear least squares."""

    @property
    def key(self) -> Key:
        """What tells two growths apart."""
        return self.candidate.names, self.candidate.integral

    @property
    def parent_place(self) -> FloatArray:
        """The place of this set at which it equals its parent."""
        return _place(self.candidate, self.parent, {})


def growths(
    base: Model, parent: Fitted[EffectSet], library: Sequence[Response], scale: float = 1.0
) -> list[Growth]:
    """Return a set's growths by one effect each, the most promising first.

    Args:
        base: whose own values are neutral.
        parent: the set, fitted.
        library: responses of the effects to consider.
        scale: of bounds in rpm and rpm/s, from `sysid.compare.study`.
    """
    orthogonal = (
        np.linalg.qr(parent.jacobian)[0] if parent.place.size else np.zeros((parent.residual.size, 0))
    )
    rest = _without(orthogonal, parent.residual)
    best: dict[Key, Growth] = {}
    for name in dict.fromkeys(response.chosen.names[0] for response in library):
        if name in parent.names:
            continue
        own = [response for response in library if response.chosen.names[0] == name]
        seen = [r for r in own if float(np.linalg.norm(r.change)) > _SEEN]
        for together in _alternatives(seen, rest, orthogonal):
            expected, shares = _linear(together, rest, orthogonal)
            candidate = joined(parent.candidate, _free(base, name, seen, together, scale))
            place = _place(candidate, parent, _moved(together, shares))
            growth = Growth(candidate, place, parent, expected)
            if growth.key not in best or expected < best[growth.key].expected:
                best[growth.key] = growth
    return sorted(best.values(), key=lambda g: (g.expected, g.key))


def _alternatives(
    own: Sequence[Response], rest: FloatArray, orthogonal: FloatArray
) -> Iterator[list[Response]]:
    """Yield the ways to try one effect: all small steps at once, each size, each parameter at its best."""
    linear = [r for r in own if r.linear and len(r.chosen.coordinates) == 1]
    if linear:
        yield linear
    others = [r for r in own if r not in linear]
    best: dict[str, tuple[float, Response]] = {}
    for response in others:
        yield [response]
        expected = _linear([response], rest, orthogonal)[0]
        parameter = response.chosen.coordinates[0].parameter
        plain = not response.chosen.integral and len(response.chosen.coordinates) == 1
        if plain and (parameter not in best or expected < best[parameter][0]):
            best[parameter] = (expected, response)
    if len(best) + len(linear) > 1 and best:
        yield [response for _, response in best.values()] + linear


def _linear(
    together: Sequence[Response], rest: FloatArray, orthogonal: FloatArray
) -> tuple[float, FloatArray]:
    """Return the square sum and the multiples of the responses that make it least."""
    columns = _without(orthogonal, np.stack([response.change for response in together], axis=1))
    low, high = np.array([_range(response) for response in together]).T
    q, triangle = np.linalg.qr(columns)
    aim = -(q.T @ rest)
    tiny = 1e-9
    shares = lsq_linear(
        np.concatenate([triangle, tiny * np.eye(len(low))]),
        np.concatenate([aim, np.zeros(len(low))]),
        bounds=(low, high),
        method="bvls",
    ).x
    return float(np.sum((rest + columns @ shares) ** 2)), shares


def _range(response: Response) -> tuple[float, float]:
    """Return which multiples of a response its parameter's bounds allow."""
    if not response.linear:
        return 0.0, _MOST_OF_A_RESPONSE
    first, place = response.chosen.coordinates[0], float(response.place[0])
    neutral = _neutral(first)
    step = place - neutral
    ends = sorted(((1.0 - neutral) / step, -neutral / step))
    return min(ends[0], 0.0) - 1e-9, max(ends[1], 0.0) + 1e-9


def _moved(together: Sequence[Response], shares: FloatArray) -> dict[Coordinate, float]:
    """Return where the responses' coordinates should start."""
    places = {}
    for response, share in zip(together, shares, strict=True):
        for index, (moved, place) in enumerate(zip(response.chosen.coordinates, response.place, strict=True)):
            if response.linear and index == 0:
                neutral = _neutral(moved)
                place = neutral + share * (place - neutral)
            places[moved] = float(np.clip(place, 0.0, 1.0))
    return places


def _free(
    base: Model, name: str, seen: Sequence[Response], together: Sequence[Response], scale: float
) -> EffectSet:
    """Return the effect with those parameters free that these logs show."""
    integral = together[0].chosen.integral
    full = effect_set(base, [name], integral=integral, scale=scale)
    shown = {c for response in (*seen, *together) for c in response.chosen.coordinates}
    # A height or a heading matters only beside its mass or slope, and is found there.
    beside = {p.name for p in CATALOGUE[name].parameters if p.neutral is None}
    if any(c.effect == name and math.isinf(c.neutral) for c in shown):
        # So does the softness of a limit that the model does not have.
        beside |= {c.parameter for c in full.coordinates if math.isfinite(c.neutral)}
    kept = tuple(c for c in full.coordinates if c in shown or c.parameter in beside or not c.effect)
    return EffectSet(full.names, kept, integral)


def _place(candidate: EffectSet, parent: Fitted[EffectSet], moved: dict[Coordinate, float]) -> FloatArray:
    known = dict(zip(parent.candidate.coordinates, parent.place.tolist(), strict=True))
    return np.array([known.get(c, moved.get(c, _neutral(c))) for c in candidate.coordinates])


def _neutral(coordinate: Coordinate) -> float:
    return coordinate.unit(coordinate.neutral) if np.isfinite(coordinate.neutral) else 1.0


def _without(orthogonal: FloatArray, columns: FloatArray) -> FloatArray:
    return columns - orthogonal @ (orthogonal.T @ columns)
