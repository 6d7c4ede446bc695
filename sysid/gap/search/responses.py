"""What one effect would change in these logs, and what adding it to a fitted set would gain.

The response of each effect is simulated once, at one or several sizes. The gain of a set by one more effect
is then estimated by linear least squares on the responses, which tells what is worth a full simulation.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final, TypeAlias

import numpy as np
from scipy.optimize import lsq_linear

from mecanum_env.effects import CATALOGUE, Effect
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.coordinates import (
    Coordinate,
    EffectSet,
    coordinate,
    effect_set,
    integral_action,
    joined,
    scanned,
)
from sysid.compare.fitted import Fitted
from sysid.compare.problem import ResidualProblem
from sysid.progress import Progress, silent

_TORQUES: Final = (0.0125, 0.05, 0.125)
"""Friction torques that are tried on a drive with integral action, on the scale 0 .. 1."""
_TYPICAL_INTEGRAL: Final = 50.0
"""Integral action with which friction is tried [N m/rad]. Assumed."""
_LARGEST_MULTIPLE: Final = 1.2
"""Largest multiple of a threshold's response that is considered, since it is not proportional to its size."""
_LEAST_RESPONSE: Final = 0.3
"""Length of a response (in noise sigmas, over all samples) below which a parameter is not fitted."""

Key: TypeAlias = tuple[tuple[str, ...], bool]
"""Names of the effects, and whether the drive is assumed to have integral action."""
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
    def length(self) -> float:
        """Norm of the change, in noise sigmas over all samples."""
        return float(np.linalg.norm(self.change))


def responses(
    problem: ResidualProblem,
    effects: Sequence[str],
    at: Model | None = None,
    tell: Progress = silent,
) -> list[Response]:
    """Return the responses of effects, in the order of the catalogue; without what cannot be simulated.

    Each effect is added to the model `at`, by default the base model of the problem; `tell` is called with
    the number of effects before each.
    """
    found = []
    ordered = [name for name in CATALOGUE if name in effects]
    start = problem.base if at is None else at
    for number, name in enumerate(ordered, 1):
        tell(f"effect {number} of {len(ordered)}")
        trials = _trials(problem.base, CATALOGUE[name], problem.probe_step([name]), problem.study.scale)
        models = [chosen.model(start, place) for chosen, place, _, _ in trials]
        covered = problem.surrogate_covers([name])
        changes = problem.changes(models, surrogate=covered, reference=start)
        for (chosen, place, linear, size), change in zip(trials, changes, strict=True):
            if change is not None:
                found.append(Response(chosen, place, change, linear, size))
    return found


def _trials(base: Model, effect: Effect, step: float, scale: float) -> list[_Trial]:
    """Return the simulations of an effect, one for each of its sizes."""
    trials: list[_Trial] = []
    searched = [p for p in effect.parameters if p.simulated and p.searched]
    primary = [p for p in searched if p.neutral is not None]
    secondary = [p for p in searched if p.neutral is None and p.scan]
    beside = [coordinate(base, effect, other, scale) for other in secondary]
    grids = [scanned(other, place, scale) for other, place in zip(secondary, beside, strict=True)]
    for parameter in primary:
        one = coordinate(base, effect, parameter, scale)
        neutral = one.neutral_place
        places = scanned(parameter, one, scale)
        linear = not places
        if linear:
            # To the side with more room: a servo can be far weaker than the model's, and hardly stiffer.
            places = [neutral + step if neutral <= 0.5 + 1e-9 else neutral - step]
        for place in places:
            size = abs(place - neutral)
            if size < 1e-9:
                continue
            # A frequency tried with one phase only would miss the other phases.
            for rest in product(*grids):
                chosen = EffectSet((effect.name,), (one, *beside))
                trials.append((chosen, np.array([place, *rest]), linear, size))
    if effect.depends_on_integral:
        trials += _with_integral(base, effect, scale)
    return trials


def _with_integral(base: Model, effect: Effect, scale: float) -> list[_Trial]:
    """Return the trials of friction with integral action; almost without it if the drive has some."""
    extra = integral_action(base)
    parameter = effect.parameters[0]
    one = coordinate(base, effect, parameter, scale)
    places = scanned(parameter, one, scale) or [one.unit(one.neutral) + x for x in _TORQUES]
    action = 0.0 if extra.neutral > 0.0 else extra.unit(_TYPICAL_INTEGRAL)
    chosen = EffectSet((effect.name,), (one, extra), integral=True)
    return [(chosen, np.array([place, action]), False, place) for place in places if place <= 1.0]


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

    @property
    def key(self) -> Key:
        """Names of the effects, and whether integral action is assumed."""
        return self.candidate.names, self.candidate.integral

    @property
    def parent_place(self) -> FloatArray:
        """The place of this set at which it equals its parent."""
        return _place(self.candidate, self.parent, {})


def growths(
    base: Model, parent: Fitted[EffectSet], library: Sequence[Response], scale: float = 1.0
) -> list[Growth]:
    """Return the growths of a fitted set by one effect each, the most promising first.

    `library` holds the responses of the effects to consider. `scale` is the factor on bounds in rpm and
    rpm/s, from `sysid.compare.problem.speed_scale`.
    """
    orthogonal = np.linalg.qr(parent.jacobian)[0]
    rest = _without(orthogonal, parent.residual)
    best: dict[Key, Growth] = {}
    for name in dict.fromkeys(r.effect for r in library if r.effect not in parent.names):
        clear = [r for r in library if r.effect == name and r.length > _LEAST_RESPONSE]
        for together in _alternatives(clear, rest, orthogonal):
            expected, shares = _linear(together, rest, orthogonal)
            candidate = joined(parent.candidate, _free(base, name, clear, together, scale))
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
    best: dict[str, tuple[float, Response]] = {}
    for response in [r for r in own if r not in linear]:
        yield [response]
        expected = _linear([response], rest, orthogonal)[0]
        parameter = response.chosen.coordinates[0].parameter
        alone = not response.chosen.integral and len(response.chosen.coordinates) == 1
        if alone and (parameter not in best or expected < best[parameter][0]):
            best[parameter] = (expected, response)
    if len(best) + len(linear) > 1 and best:
        yield [response for _, response in best.values()] + linear


def _linear(
    together: Sequence[Response], rest: FloatArray, orthogonal: FloatArray
) -> tuple[float, FloatArray]:
    """Return the smallest cost and the multiples of the responses at which it is reached."""
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
    base: Model, name: str, clear: Sequence[Response], together: Sequence[Response], scale: float
) -> EffectSet:
    """Return the effect with those parameters free to which these logs respond."""
    integral = together[0].chosen.integral
    full = effect_set(base, [name], integral=integral, scale=scale)
    shown = {c for response in (*clear, *together) for c in response.chosen.coordinates}
    # A height or a heading matters only together with its mass or slope.
    beside = {p.name for p in CATALOGUE[name].parameters if p.neutral is None}
    if any(c.effect == name and math.isinf(c.neutral) for c in shown):
        # So does the softness of a limit matter only with a limit that the model does not have.
        beside |= {c.parameter for c in full.coordinates if math.isfinite(c.neutral)}
    kept = tuple(c for c in full.coordinates if c in shown or c.parameter in beside or not c.effect)
    return EffectSet(full.names, kept, integral)


def _place(candidate: EffectSet, parent: Fitted[EffectSet], moved: dict[Coordinate, float]) -> FloatArray:
    known = dict(zip(parent.candidate.coordinates, parent.place.tolist(), strict=True))
    return np.array([known.get(c, moved.get(c, c.neutral_place)) for c in candidate.coordinates])


def _without(orthogonal: FloatArray, columns: FloatArray) -> FloatArray:
    return columns - orthogonal @ (orthogonal.T @ columns)
