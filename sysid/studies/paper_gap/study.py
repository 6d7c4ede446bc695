"""The study of the paper's gap: what each effect changes, which sets reproduce all six numbers, the suspects.

The paper suspects load, rolling friction, latency and saturation; they are fitted alone and together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from mecanum_env.effects import CATALOGUE
from mecanum_env.model import Model, paper_model
from mecanum_env.parallel import Executor, Task, Workers, executor
from mecanum_env.units import FloatArray
from sysid.progress import Progress, silent
from sysid.studies.paper_gap.drives import DRIVES, HOLD_S, PAPER, TOLERANCE, drive_metrics, turn_losses
from sysid.studies.paper_gap.sets import LEFT_OUT, Fitter, SetFit

_BEAM: Final = {1: 3, 2: 4, 3: 5}
"""Size -> number of its best sets from which larger sets grow."""
_PROMISING: Final = 7
"""Number of most promising effects that are tried as additions to a set."""
_SIZES: Final = (0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0)


@dataclass(frozen=True, eq=False)
class Reach:
    """Range over which one effect alone changes each number, at sizes across its bounds."""

    name: str
    least: FloatArray
    """Smallest change, shape (6,)."""
    most: FloatArray
    """Largest change, shape (6,)."""

    @property
    def moves(self) -> FloatArray:
        """Which numbers it changes by more than the tolerance, shape (6,), bool."""
        return np.asarray(np.maximum(self.most, -self.least) > TOLERANCE)


def reaches(base: Model, pool: Executor) -> list[Reach]:
    """Return the range of each effect of the catalogue on the six numbers of the base model, found by a pool.

    The first form of a cause stands for the others, which six numbers do not tell apart.
    """
    names = [
        name
        for name, effect in CATALOGUE.items()
        if not (
            name in LEFT_OUT
            or name != effect.cause
            or "rollers" in effect.unsearched_on
            or effect.search_from
        )
    ]
    return pool.run([Task(name, _reach, (base, name)) for name in names])


def _reach(base: Model, name: str) -> Reach:
    """Return the range of the effect with this name."""
    fitter = Fitter(base, "planar" if CATALOGUE[name].acts_in("planar") else "rollers", hold_s=HOLD_S)
    chosen = fitter.set_of([name])
    start, before, rows = chosen.start(), fitter.empty().six, []
    for index in range(start.size):
        for size in _SIZES:
            place = start.copy()
            place[index] = size
            rows.append(fitter.six(chosen, place) - before)
    changes = np.array(rows)
    return Reach(name, np.nanmin(changes, axis=0), np.nanmax(changes, axis=0))


def _movers(found: Sequence[Reach]) -> tuple[str, ...]:
    """Return the effects of the planar plant that change any of the numbers."""
    return tuple(r.name for r in found if r.moves.any() and CATALOGUE[r.name].acts_in("planar"))


def _grown_sets(
    base: Model, names: Sequence[str], most: int, pool: Executor
) -> dict[tuple[str, ...], SetFit]:
    """Return all fitted sets, by their names: all single effects, then additions to the best sets.

    `names` are the effects to consider; a set has at `most` so many effects.
    """
    fitted: dict[tuple[str, ...], SetFit] = {(): Fitter(base).empty()}
    for size in range(1, most + 1):
        # A set that already reproduces the numbers needs no addition.
        parents = [f for f in best(fitted, size - 1) if f.worst > 1.0]
        for parent in parents[: _BEAM.get(size - 1, 1)]:
            grown = _grown(base, parent, names, pool)[: len(names) if size == 1 else _PROMISING]
            new = [start for start in grown if start.names not in fitted]
            fits = pool.run([Task(_title(start.names), Fitter(base).fit, (start,)) for start in new])
            fitted |= {fit.names: fit for fit in fits}
    return fitted


def best(fitted: Mapping[tuple[str, ...], SetFit], size: int) -> list[SetFit]:
    """Return the fitted sets of a size, best first."""
    return sorted((f for f in fitted.values() if len(f.names) == size), key=lambda f: (f.misfit, f.names))


def needless(found: SetFit, fitted: Iterable[SetFit]) -> bool:
    """Return whether one of all fitted sets, inside the found one, reproduces the numbers as well."""
    return any(set(f.names) < set(found.names) and f.worst <= 1.0 for f in fitted)


def _grown(base: Model, parent: SetFit, names: Sequence[str], pool: Executor) -> list[SetFit]:
    """Return a set together with each of the other effects, not fitted yet, the most promising first."""
    others = [name for name in names if name not in parent.names]
    # Each task has a fitter of its own: what one remembers must not depend on who did what.
    starts = pool.run(
        [Task(_title((*parent.names, name)), Fitter(base).start, (parent, name)) for name in others]
    )
    return [s for s, _ in sorted(zip(starts, others, strict=True), key=lambda s: (s[0].misfit, s[1]))]


def _title(names: Sequence[str]) -> str:
    return " + ".join(names)


_CEILING: Final = (("speed_saturation", "softness_rpm"),)
_FRICTION: Final = ("coulomb_friction", "viscous_friction")
ALL_SOFT: Final = "all, saturation a soft knee"
"""Title of all suspects together."""
TURN: Final = len(DRIVES) - 1
"""Index of the turn's loss among the six numbers."""
TURN_SPEEDS_RPM: Final = np.array([5.0, *range(10, 131, 10)])
"""Wheel speeds of the simulated turns; the text does not print that of its turn [rpm]."""
INTEGRAL_N_M_RAD: Final = 50.0
"""Integral gain of a drive with integral action."""


@dataclass(frozen=True, eq=False)
class Turn:
    """All suspects fitted to everything except the turn, and their prediction of turns."""

    fit: SetFit
    losses: FloatArray
    """Losses at `TURN_SPEEDS_RPM`."""


def suspects(base: Model, pool: Executor) -> dict[str, SetFit]:
    """Fit the paper's suspects to its six numbers, alone and together, in a pool; return title -> fit.

    Sensor latency is in none of the larger sets because it changes none of the numbers.
    """
    together = ("speed_saturation", "coulomb_friction", "viscous_friction", "payload")
    ceiling = partial(Fitter, base, neutral=_CEILING)
    plain, integral = partial(Fitter, base), partial(Fitter, _with_integral(base))
    fits: dict[str, tuple[Callable[[], Fitter], Sequence[str]]] = {
        "load": (plain, ["payload"]),
        "sensor latency": (plain, ["sensor_latency"]),
        "rolling friction": (plain, _FRICTION),
        "saturation, a ceiling": (ceiling, ["speed_saturation"]),
        "saturation, a soft knee": (plain, ["speed_saturation"]),
        "load and rolling friction": (plain, [*_FRICTION, "payload"]),
        "all, saturation a ceiling": (ceiling, together),
        ALL_SOFT: (plain, together),
        "the same, a drive with integral action": (integral, together),
    }
    tasks = [Task(title, fitter().built, (names,)) for title, (fitter, names) in fits.items()]
    return dict(zip(fits, pool.run(tasks), strict=True))


def _suspects_turning(base: Model) -> Turn:
    """Fit all suspects, added to a base model, to the straight drives, and predict turns at all speeds."""
    counted = np.ones(PAPER.size)
    counted[TURN] = 0.0
    fitter = Fitter(base, counted=counted)
    found = fitter.built(("speed_saturation", "coulomb_friction", "weak_servo"))
    return Turn(found, turn_losses(fitter.model(found.chosen, found.place), TURN_SPEEDS_RPM))


def _with_integral(base: Model) -> Model:
    """Return the model with integral action in its drives."""
    return replace(base, robot=replace(base.robot, servo_integral_n_m_rad=INTEGRAL_N_M_RAD))


STAGES: Final = 5
_MOST_EFFECTS: Final = 4
"""Largest number of effects in a set; with more there are more parameters than numbers."""
_NEAREST: Final = 5
"""Number of sets of each size in the table, besides those that reproduce all numbers."""


@dataclass(frozen=True, eq=False)
class PaperGap:
    """What was found."""

    reach: tuple[Reach, ...]
    """Every effect alone."""
    sets: tuple[SetFit, ...]
    """The best sets of each size and all that reproduce the six numbers; fewest parameters first."""
    worsts: FloatArray
    """The largest deviation of every set that was fitted, needless ones left out."""
    on_rollers: tuple[FloatArray, ...]
    """The six numbers on rollers of each set that reproduces them, in the order of `reproducing`."""
    suspects: Mapping[str, SetFit]
    """Title of one or more of the paper's suspects -> their best fit."""
    turn: Turn
    integral: SetFit
    """The best of the sets on a drive with integral action."""
    base: FloatArray
    """The six numbers of the unchanged model, on rollers."""

    @property
    def reproducing(self) -> tuple[SetFit, ...]:
        """The sets that reproduce all six numbers within the tolerance, fewest parameters first."""
        return tuple(found for found in self.sets if found.worst <= 1.0)


def paper_gap(progress: Progress = silent, workers: Workers | None = None) -> PaperGap:
    """Search for sets of effects that reproduce the six numbers; report `progress` before each step.

    Fits run on `workers`, by default on all processors of this machine.
    """
    base = paper_model()
    with executor(workers or Workers()) as pool:
        progress("what each effect can do")
        reach = reaches(base, pool)
        names = _movers(reach)
        progress("the paper's suspects")
        suspected = suspects(base, pool)
        (turn,) = pool.run([Task("suspects turning", _suspects_turning, (base,))])
        progress("sets of effects")
        fitted = _grown_sets(base, names, _MOST_EFFECTS, pool)
        kept = [f for f in fitted.values() if not needless(f, fitted.values())]
        sets = _shown(kept)
        progress("a drive with integral action")
        first = min(kept, key=lambda f: f.misfit)
        again = Task("integral action", Fitter(_with_integral(base)).built, (first.names,))
        (integral,) = pool.run([again])
        progress("on rollers")
        models = [Fitter(base).model(f.chosen, f.place) for f in sets if f.worst <= 1.0]
        plain, *rollers = pool.run([Task("on rollers", _on_rollers, (model,)) for model in (base, *models)])
    return PaperGap(
        reach=tuple(reach),
        sets=sets,
        worsts=np.array([f.worst for f in kept]),
        on_rollers=tuple(rollers),
        suspects=suspected,
        turn=turn,
        integral=integral,
        base=plain,
    )


def _on_rollers(model: Model) -> FloatArray:
    return drive_metrics(model, "rollers").six


def _shown(fitted: list[SetFit]) -> tuple[SetFit, ...]:
    """Return the sets that reproduce all six numbers and the nearest of each size."""
    ordered = sorted(fitted, key=lambda f: (f.chosen.parameter_count, f.misfit, f.names))
    nearest = {
        f.names
        for size in range(1, _MOST_EFFECTS + 1)
        for f in sorted((f for f in fitted if len(f.names) == size), key=lambda f: f.misfit)[:_NEAREST]
    }
    return tuple(f for f in ordered if f.worst <= 1.0 or f.names in nearest)
