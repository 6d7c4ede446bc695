"""What one effect would change in these logs, and what adding it to a fitted set would gain.

The response of each effect is simulated once, at one or several sizes. The gain of a set by one more effect
is then estimated by linear least squares on the responses, which tells what is worth a full simulation.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Final, TypeAlias

import numpy as np
from scipy.optimize import lsq_linear

from mecanum_env.effects import CATALOGUE, Effect
from mecanum_env.effects.scale import REFERENCE, Scale
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.least_squares import Fitted, ResidualProblem, likely_frequencies
from sysid.compare.search_space import (
    Coordinate,
    EffectSet,
    components,
    coordinate,
    effect_set,
    joined,
    scanned,
    searched_alone,
)
from sysid.progress import Progress, silent

_LARGEST_MULTIPLE: Final = 1.2
"""Largest multiple of a threshold's response that is considered, since it is not proportional to its size."""
_MOST_FREQUENCIES: Final = 2
"""Frequencies over the wheel's angle at which an effect is simulated: those that the residual shows most."""
_CLEARLY_MORE: Final = 0.25
"""Share of a gain that a sum of responses must promise beyond it where they do not add up, as those of two
limits do not, either of which may hide the other. Assumed."""
_MOST_STARTS: Final = 2
"""Sizes at which an effect was simulated from which a fit on the bench starts, too: from where the screening
expects the best fit, a descent to a large threshold may end higher than without it (bench seed 867)."""
_LEAST_RESPONSE: Final = 0.3
"""Length of a response (in noise sigmas, over all samples) below which a parameter is not fitted."""

_Trial: TypeAlias = tuple[EffectSet, FloatArray, bool, float]
"""What is simulated: an effect as a set, its place, whether it is linear, and its size as in `Response`."""


@dataclass(frozen=True, eq=False)
class Response:
    """Change of the marginal residual by one effect."""

    chosen: EffectSet
    """The effect, with the coordinates that were moved."""
    place: FloatArray
    """Where they were moved to, shape (p,)."""
    change: FloatArray
    """Marginal residual at that place less that without the effect, shape (N,)."""
    linear: bool
    """Whether it is from a small step, so that its multiples mean something, negative ones too."""
    size: float
    """Distance of the first coordinate from neutral, 0 .. 1."""

    @property
    def effect(self) -> str:
        """Name of the effect."""
        return self.chosen.names[0]

    @property
    def beside(self) -> tuple[float, ...]:
        """Where the coordinates beside the first one are."""
        return tuple(self.place[1:].tolist())

    @property
    def length(self) -> float:
        """Norm of the change, in noise sigmas over all samples."""
        return float(np.linalg.norm(self.change))


@dataclass(frozen=True, eq=False)
class Library:
    """What the considered effects would do in some logs."""

    searched: Sequence[Response]
    """Of the effects that are looked for."""
    left_out: Sequence[Response] = ()
    """Of effects that explain no more of the logs than the model's own error may."""
    least: Mapping[str, float] = field(default_factory=dict)
    """Effect -> fall of the cost above which it is more than that error, for each that may be among it."""


def responses(
    problem: ResidualProblem,
    effects: Sequence[str],
    at: Model | None = None,
    tell: Progress = silent,
    per_turn: Collection[int] = (),
) -> list[Response]:
    """Return the responses of effects, in the order of the catalogue; without what cannot be simulated.

    Each effect is added to the model `at`, by default the base model of the problem; `tell` is called with
    the number of effects before each. Ripples are tried with the periods per turn that the residual shows
    most, and with those of `per_turn`.
    """
    found = []
    ordered = [name for name in CATALOGUE if name in effects]
    start = problem.base if at is None else at
    for number, name in enumerate(ordered, 1):
        tell(f"effect {number} of {len(ordered)}")
        effect, step, scale = CATALOGUE[name], problem.probe_step([name]), problem.settings.scale
        if effect.follows_angle:
            periods = dict.fromkeys((*_frequencies(problem), *per_turn))
            trials = [t for k in periods for t in _trials(problem.base, effect, step, scale, k)]
        else:
            trials = _trials(problem.base, effect, step, scale)
        models = [chosen.model(start, place) for chosen, place, _, _ in trials]
        covered = problem.surrogate_covers([name])
        changes = problem.changes(models, surrogate=covered, reference=start)
        for (chosen, place, linear, size), change in zip(trials, changes, strict=True):
            if change is not None:
                found.append(Response(chosen, place, change, linear, size))
    return found


def _frequencies(problem: ResidualProblem) -> tuple[int, ...]:
    """Return the periods per turn at which an effect that follows the wheel's angle is tried."""
    blocks, rows = problem.observations.blocks, problem.whitener.slices
    return likely_frequencies(problem.base_residual, blocks, rows, _MOST_FREQUENCIES)


def _trials(
    base: Model, effect: Effect, step: float, scale: Scale, per_turn: int | None = None
) -> list[_Trial]:
    """Return the simulations of an effect, one for each of its sizes, if it has a frequency `per_turn`."""
    trials: list[_Trial] = []
    known = {p: coordinate(base, effect, p, scale) for p in searched_alone(effect)}
    secondary = [p for p in known if p.neutral is None and p.scan]
    beside_first = {p: one for p, one in known.items() if p.multiples}
    fixed = effect_set(base, [effect.name], scale=scale).fixed
    if per_turn is not None:
        fixed = (*fixed, (effect.name, "per_turn", float(per_turn)))
    beside = [known[other] for other in secondary]
    grids = [scanned(other, known[other], scale) for other in secondary]
    moved = [(one, scanned(p, one, scale)) for p, one in known.items() if p.neutral is not None]
    moved += [(one, []) for one in components(base, effect, scale)]
    for one, places in moved:
        neutral = one.neutral_place
        linear = not places
        if linear:
            # To the side with more room: a servo can be far weaker than the model's, and hardly stiffer.
            places = [neutral + step if neutral <= 0.5 + 1e-9 else neutral - step]
        for place in places:
            size = abs(place - neutral)
            if size < 1e-9:
                continue
            for rest in product(*grids):
                chosen = EffectSet((effect.name,), (one, *beside), fixed)
                trials.append((chosen, np.array([place, *rest]), linear, size))
            is_first = one.parameter == effect.parameters[0].name
            for other, its_place in beside_first.items() if is_first else ():
                both = EffectSet((effect.name,), (one, its_place), fixed)
                at = [one.unit(multiple * one.value(place)) for multiple in other.multiples]
                trials += [(both, np.array([place, x]), False, size) for x in at if 0.0 < x < 1.0]
    return trials


@dataclass(frozen=True, eq=False)
class Growth:
    """A set that has one effect more than a fitted one, and may be fitted in turn."""

    candidate: EffectSet
    place: FloatArray
    """Where a fit should start, shape (p,)."""
    parent: Fitted[EffectSet]
    """The smaller set."""
    expected: float
    """Cost that linear least squares expects."""
    elsewhere: tuple[tuple[float, FloatArray], ...] = ()
    """Other places to start from, each behind its cost: sizes at which the effect was simulated."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return self.candidate.names

    @property
    def parent_place(self) -> FloatArray:
        """The place of this set at which it equals its parent."""
        return _place(self.candidate, self.parent, {})


def growths(
    base: Model,
    parent: Fitted[EffectSet],
    library: Sequence[Response],
    scale: Scale = REFERENCE,
    *,
    wary: bool = False,
) -> list[Growth]:
    """Return the growths of a fitted set by one effect each, the most promising first.

    `library` holds the responses of the effects to consider. `scale` is that of the drive and the
    logs, from `sysid.compare.search_space.scale`. `wary`: responses that are not proportional to their sizes
    are only added up where that promises clearly more than one of them.
    """
    orthogonal = np.linalg.qr(parent.jacobian)[0]
    rest = _without(orthogonal, parent.residual)
    best: dict[tuple[str, ...], Growth] = {}
    for name in dict.fromkeys(r.effect for r in library if r.effect not in parent.names):
        clear = [r for r in library if r.effect == name and r.length > _LEAST_RESPONSE]
        sizes = _best_sizes(parent, clear)
        for together in _alternatives(clear, rest, orthogonal):
            expected, shares = _linear(together, rest, orthogonal)
            candidate = joined(parent.candidate, _free(base, name, clear, together, scale))
            place = _place(candidate, parent, _moved(together, shares))
            elsewhere = tuple(
                (cost, _place(candidate, parent, moved))
                for cost, moved in sizes
                if moved.keys() <= set(candidate.coordinates)
            )
            growth = Growth(candidate, place, parent, expected, elsewhere)
            limit = best[growth.names].expected if growth.names in best else math.inf
            if wary and limit < math.inf and len(together) > 1 and not all(r.linear for r in together):
                limit -= _CLEARLY_MORE * (float(rest @ rest) - limit)
            if expected < limit:
                best[growth.names] = growth
    return sorted(best.values(), key=lambda g: (g.expected, g.names))


def _alternatives(
    own: Sequence[Response], rest: FloatArray, orthogonal: FloatArray
) -> Iterator[list[Response]]:
    """Yield the ways to try one effect: all small steps at once, each size, each parameter at its best.

    Small steps beside different values of another parameter, such as the frequency of a ripple, are no sum.
    """
    steps: dict[tuple[float, ...], list[Response]] = {}
    for response in own:
        if response.linear:
            steps.setdefault(response.beside, []).append(response)
    yield from steps.values()
    linear = steps.get((), [])
    best: dict[str, tuple[float, Response]] = {}
    for response in [r for r in own if not r.linear]:
        yield [response]
        expected = _linear([response], rest, orthogonal)[0]
        parameter = response.chosen.coordinates[0].parameter
        alone = len(response.chosen.coordinates) == 1
        if alone and (parameter not in best or expected < best[parameter][0]):
            best[parameter] = (expected, response)
    # Unknown phases make responses that do not add up.
    adds_up = not any(CATALOGUE[response.effect].follows_angle for response in own)
    if len(best) + len(linear) > 1 and best and adds_up:
        yield [response for _, response in best.values()] + linear


def _best_sizes(
    parent: Fitted[EffectSet], own: Sequence[Response]
) -> list[tuple[float, dict[Coordinate, float]]]:
    """Return where one effect was simulated that is not proportional to its size, the lowest costs first.

    The cost is in front, and behind it where the coordinates are.
    """
    found = [
        (
            float(np.sum((parent.residual + r.change) ** 2)),
            dict(zip(r.chosen.coordinates, r.place.tolist(), strict=True)),
        )
        for r in own
        if not r.linear
    ]
    return sorted(found, key=lambda one: one[0])[:_MOST_STARTS]


def _linear(
    together: Sequence[Response], rest: FloatArray, orthogonal: FloatArray
) -> tuple[float, FloatArray]:
    """Return the smallest cost and the multiples of the responses at which it is reached."""
    columns = _without(orthogonal, np.stack([response.change for response in together], axis=1))
    low, high = np.array([_range(response) for response in together]).T
    tiny = 1e-9
    if len(together) == 1:
        # By far the most frequent case, for which the general solution takes longer than all simulations.
        column = columns[:, 0]
        shares = np.clip([-(column @ rest) / (column @ column + tiny**2)], low, high)
    else:
        q, triangle = np.linalg.qr(columns)
        shares = lsq_linear(
            np.concatenate([triangle, tiny * np.eye(len(low))]),
            np.concatenate([-(q.T @ rest), np.zeros(len(low))]),
            bounds=(low, high),
            method="bvls",
        ).x
    return float(np.sum((rest + columns @ shares) ** 2)), shares


def _range(response: Response) -> tuple[float, float]:
    """Return which multiples of a response the bounds of its parameter allow."""
    if not response.linear:
        return 0.0, _LARGEST_MULTIPLE
    neutral = response.chosen.coordinates[0].neutral_place
    step = float(response.place[0]) - neutral
    ends = sorted(((1.0 - neutral) / step, -neutral / step))
    return min(ends[0], 0.0) - 1e-9, max(ends[1], 0.0) + 1e-9


def _moved(together: Sequence[Response], shares: FloatArray) -> dict[Coordinate, float]:
    """Return where a fit should start along the coordinates of the responses."""
    places = {}
    for response, share in zip(together, shares, strict=True):
        for index, (moved, place) in enumerate(zip(response.chosen.coordinates, response.place, strict=True)):
            if response.linear and index == 0:
                place = moved.neutral_place + share * (place - moved.neutral_place)
            places[moved] = float(np.clip(place, 0.0, 1.0))
    return places


def _free(
    base: Model, name: str, clear: Sequence[Response], together: Sequence[Response], scale: Scale
) -> EffectSet:
    """Return the effect with those parameters free to which these logs respond."""
    full = effect_set(base, [name], scale=scale)
    # A height or a heading matters only together with its mass or slope.
    beside = {p.name for p in CATALOGUE[name].parameters if p.neutral is None}
    if CATALOGUE[name].follows_angle:
        own = together[0].chosen
        more = (c for c in full.coordinates if c.parameter in beside and c not in own.coordinates)
        return EffectSet(own.names, (*own.coordinates, *more), own.fixed)
    shown = {c for response in (*clear, *together) for c in response.chosen.coordinates}
    if any(c.effect == name and math.isinf(c.neutral) for c in shown):
        # So does the softness of a limit matter only with a limit that the model does not have.
        beside |= {c.parameter for c in full.coordinates if math.isfinite(c.neutral)}
    kept = [c for c in full.coordinates if c in shown or c.parameter in beside or c.axis]
    # What equals another parameter as long as it is neutral is free only where that was tried.
    kept += [c for response in together for c in response.chosen.coordinates if c.like and c not in kept]
    return EffectSet(full.names, tuple(kept), together[0].chosen.fixed)


def _place(candidate: EffectSet, parent: Fitted[EffectSet], moved: dict[Coordinate, float]) -> FloatArray:
    known = dict(zip(parent.candidate.coordinates, parent.place.tolist(), strict=True))
    return np.array([known.get(c, moved.get(c, c.neutral_place)) for c in candidate.coordinates])


def _without(orthogonal: FloatArray, columns: FloatArray) -> FloatArray:
    return columns - orthogonal @ (orthogonal.T @ columns)
