"""A custom effect for a gap that no named effect explains: the shortest formula that does, and where it acts.

Every term of a small library is put into the simulation at every station; what it changes there is its
column. `sysid.gap.search.selection` chooses terms by these columns, as many as hold on command sequences left
out. The formulas, and tables beside them, are then fitted inside the simulation, and the score of a set of
effects (`sysid.gap.search.scores`) decides between them: of all within the margin of a tie the shortest is
proposed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.effects import CATALOGUE
from mecanum_env.errors import InputError
from mecanum_env.model import CustomEffect, Model
from mecanum_env.units import FloatArray
from sysid.compare.least_squares import Fitted, ResidualProblem, base_fit, fit
from sysid.compare.search_space import EffectSet
from sysid.gap.search.scores import group_masks, rises, scored
from sysid.gap.search.selection import Choice, choose
from sysid.gap.search.terms import Extent, Formula, FreeTable, tables_at, terms_at, with_ranges
from sysid.gap.search.thresholds import THRESHOLDS

_STEP: Final = 1e-3
"""Largest value of a term when its response is simulated, in shares of the top speed."""
_DIGITS: Final = 4
"""Digits of the numbers of a proposed effect."""
_PIECES: Final = 4
"""Parts of each run, where one command sequence is all there is to leave out."""
_ROBOT_FITS: Final = 2
"""Most candidates that are fitted on rollers, where a fit takes minutes."""


@dataclass(frozen=True)
class Proposal:
    """A custom effect that the logs suggest."""

    effect: CustomEffect
    explained: float
    """Share of the squared difference, in command sequences left out, that it explains."""
    stations_tied: tuple[str, ...]
    """Other stations at which an effect of another formula explains these logs as well."""


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A formula or a table, chosen by linear responses."""

    free: Formula | FreeTable
    place: FloatArray
    explained: float

    @property
    def station(self) -> str:
        return self.free.station


def propose(problem: ResidualProblem, *, whole: bool = True) -> Proposal | None:
    """Return the custom effect that describes best what the base model of a problem leaves.

    None if no formula and no table holds on command sequences left out. `whole`: no run of the problem is a
    piece of a longer one; in pieces neither time nor angle since the start is known.
    """
    base = base_fit(problem, EffectSet((), ()))
    extent = _extent(problem, whole=whole)
    found = [
        candidate
        for station in _stations(problem.base)
        for candidate in _candidates(problem, base.residual, station, extent)
    ]
    if problem.has_surrogate:
        found = sorted(found, key=lambda candidate: -candidate.explained)[:_ROBOT_FITS]
    fits = {candidate: fitted for candidate in found if (fitted := _fitted(problem, candidate)) is not None}
    if not fits:
        return None
    inflation = max(1.0, min(one.cost / (problem.size - one.place.size) for one in fits.values()))
    margin = THRESHOLDS.tie_sigmas**2
    needed = scored(problem, base, inflation).score - margin
    scores = {
        candidate: score
        for candidate, fitted in fits.items()
        if (score := scored(problem, fitted, inflation).score) < needed and not rises(problem, base, fitted)
    }
    if not scores:
        return None
    tied = [candidate for candidate in scores if scores[candidate] <= min(scores.values()) + margin]
    # Stations are tried in the order of `_stations`, and of equals the first is taken.
    best = min(tied, key=lambda candidate: candidate.free.parameter_count)
    numbers = best.free.numbers(fits[best].place).tolist()
    return Proposal(
        with_ranges(best.free.effect(numbers, _DIGITS), extent),
        best.explained,
        tuple(dict.fromkeys(other.station for other in tied if other.station != best.station)),
    )


def _stations(base: Model) -> tuple[str, ...]:
    """Return the stations worth trying: command and set-point are one where nothing acts between them."""
    between = any(CATALOGUE[name].station == "set_point" for name in base.effects)
    return ("set_point", *(("command",) if between else ()), "load", "sensor")


def _candidates(
    problem: ResidualProblem, target: FloatArray, station: str, extent: Extent
) -> Iterator[_Candidate]:
    """Yield what holds on parts left out: formulas of one term, of two and so on, and tables."""
    parts = _parts(problem)
    terms = terms_at(station, extent)
    chosen = _choice(problem, target, [Formula(station, (term,), extent.top_rpm) for term in terms], parts)
    for count in range(1, len(chosen.terms) + 1 if chosen else 1):
        assert chosen is not None
        first = chosen.first(count)
        formula = Formula(station, tuple(terms[index] for index in first.terms), extent.top_rpm)
        coefficients = [value for values in first.coefficients for value in values]
        yield _Candidate(formula, formula.start_of(coefficients), first.explained)
    for table in tables_at(station, extent):
        one = _choice(problem, target, [table], parts)
        if one is not None:
            yield _Candidate(table, table.place(np.array(one.coefficients[0])), one.explained)


def _choice(
    problem: ResidualProblem,
    target: FloatArray,
    free: Sequence[Formula] | Sequence[FreeTable],
    parts: Sequence[npt.NDArray[np.bool_]],
) -> Choice | None:
    """Return the choice among formulas of one term each, or tables, by their responses in the simulation."""
    models, steps, widths = [], [], []
    for one in free:
        shapes = [term.shape for term in one.terms if term.shape] if isinstance(one, Formula) else []
        count = one.parameter_count - len(shapes)
        widths.append(count)
        step = _STEP * one.top_rpm / (one.terms[0].size if isinstance(one, Formula) else 1.0)
        for own in range(count):
            numbers = [*(step if index == own else 0.0 for index in range(count)), *shapes]
            steps.append(step)
            try:
                models.append(problem.base.with_custom(one.effect(numbers)))
            except InputError:
                return None  # the model has custom effects there already, which leave no room
    changes = problem.changes(models, surrogate=problem.has_surrogate, reference=problem.base)
    columns = [
        np.zeros(problem.size) if change is None else -change / step
        for change, step in zip(changes, steps, strict=True)
    ]
    return choose(target, np.stack(columns, axis=1), widths, parts)


def _fitted(problem: ResidualProblem, candidate: _Candidate) -> Fitted[Formula | FreeTable] | None:
    try:
        return fit(problem, candidate.free, candidate.place)
    except InputError:
        return None  # the formula takes more room than there is


def _parts(problem: ResidualProblem) -> list[npt.NDArray[np.bool_]]:
    """Return which values belong to each part that is left out in turn: each command sequence."""
    groups = group_masks(problem)
    if len(groups) > 1:
        return groups
    pieces = [np.zeros(problem.size, bool) for _ in range(_PIECES)]
    for rows in problem.whitener.slices:
        for piece, members in zip(
            pieces, np.array_split(np.arange(rows.start, rows.stop), _PIECES), strict=True
        ):
            piece[members] = True
    return pieces


def _extent(problem: ResidualProblem, *, whole: bool) -> Extent:
    runs = [run for situation in problem.observations.situations for run in situation.runs]
    commands = np.concatenate([run.command.wheels_rpm.ravel() for run in runs])
    measured = [v for run in runs for name, v in run.channels.items() if name.startswith("speed_")]
    speeds = np.concatenate(measured) if measured else commands
    longest = max(run.duration_s for run in runs)
    ranges = [
        (name, float(f"{np.nanmin(values):.4g}"), float(f"{np.nanmax(values):.4g}"))
        for name, values in (("command_rpm", commands), ("speed_rpm", speeds))
    ]
    top = max(abs(end) for _, *ends in ranges for end in ends)
    return Extent(top, longest, (*ranges, ("time_s", 0.0, float(f"{longest:.4g}"))), whole)
