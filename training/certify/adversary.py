"""The adversary of a certificate: an opponent searched against the controller.

Its parameters stay within the ranges of people (`mecanum_env.tankendo.opponents.PARAMETERS`); it may also
keep to one technique. The search is the cross-entropy method (R. Rubinstein, "The cross-entropy method for
combinatorial and continuous optimization", Methodology and Computing in Applied Probability 1, 1999):
candidates play a few episodes each, and the next ones are drawn around the centre of the best, with their
spread. The first generation is large: what beats a controller is often a small part of twenty ranges, which
few candidates miss by chance. Candidates of a generation play the same seeds, which no other row has.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from mecanum_env.parallel import Workers
from mecanum_env.tankendo import Opponent
from mecanum_env.tankendo.opponents import PARAMETERS, RANGED, with_parameters
from mecanum_env.units import FloatArray
from training.evaluate import Job, Setup, play_jobs
from training.evaluate.play import Progress

FIRST_SEED: Final = 300_000
"""Seed of the first episode of a search."""
_START_SPREAD, _LEAST_SPREAD = 0.35, 0.08
"""Standard deviation of the candidates at first, and at least, as a share of each range. Of the first ones
three numbers in twenty are drawn beyond an end of their range, and so lie at it."""


@dataclass(frozen=True)
class Search:
    """How long an adversary is searched."""

    first: int = 128
    """Opponents of the first generation."""
    generations: int = 4
    candidates: int = 24
    """Opponents of each further generation."""
    best: int = 8
    """How many of them the next generation is drawn around."""
    episodes: int = 20
    """Episodes of each candidate; those of the last generation's best play twice as many anew."""
    seed: int = 0
    """Seed of the candidates."""

    @property
    def total(self) -> int:
        """Number of episodes that a search plays."""
        return (self.first + (self.generations - 1) * self.candidates + 2 * self.best) * self.episodes


def size_of_search() -> int:
    """Return how many numbers describe an opponent of the search."""
    return sum(1 + (one.name in RANGED) for one in PARAMETERS) + 1


def opponent_at(point: FloatArray, base: Opponent) -> Opponent:
    """Return the opponent at a point of the unit cube, shape (`size_of_search()`,), that is else `base`.

    A range takes two numbers: where its lower end lies, and where its upper end between that and the top. The
    last number chooses all techniques or one of them.
    """
    shares = iter(np.clip(point, 0.0, 1.0).tolist())
    values: dict[str, Any] = {}
    for one in PARAMETERS:
        share = next(shares)
        if one.name == "lead_form":
            values[one.name] = one.ends[_choice(share, len(one.ends))]
            continue
        low, high = (float(end) for end in one.ends)
        number = low + share * (high - low)
        values[one.name] = (number, number + next(shares) * (high - number)) if one.name in RANGED else number
    found = with_parameters(base, values)
    chosen = _choice(next(shares), len(found.techniques) + 1)
    return replace(found, techniques=found.techniques[chosen - 1 : chosen]) if chosen > 0 else found


def _choice(share: float, count: int) -> int:
    """Return which of `count` choices a share from 0 to 1 selects."""
    return min(int(share * count), count - 1)


def worst_opponent(
    controller: str,
    setup: Setup,
    base: Opponent,
    search: Search,
    workers: Workers | None = None,
    progress: Progress | None = None,
) -> Opponent:
    """Return the opponent against which a controller wins least of those that were tried.

    Args:
        controller: its name or path.
        setup: robot, physics and difficulty.
        base: what is not searched.
        search: how many opponents are tried, and how long.
        workers: where the episodes are played, which does not change the result.
        progress: called with the name of what was played and the number of episodes.
    """
    rng = np.random.default_rng(search.seed)

    def successes(points: FloatArray, first_seed: int, episodes: int) -> FloatArray:
        jobs = {
            str(i): Job(
                "adversary",
                controller,
                replace(setup, opponent=opponent_at(point, base)),
                episodes,
                first_seed,
            )
            for i, point in enumerate(points)
        }
        played = play_jobs(jobs, workers, progress)
        return np.array([played[key].success.value for key in jobs])

    def around(centre: FloatArray, spread: FloatArray, count: int) -> FloatArray:
        drawn = rng.standard_normal((count, len(centre)))
        return np.asarray(np.clip(centre + spread * drawn, 0.0, 1.0))

    def best_of(points: FloatArray, generation: int) -> FloatArray:
        found = successes(points, FIRST_SEED + generation * search.episodes, search.episodes)
        best: FloatArray = points[np.argsort(found, kind="stable")[: search.best]]
        return best

    middle, wide = np.full(size_of_search(), 0.5), np.full(size_of_search(), _START_SPREAD)
    elite = best_of(around(middle, wide, search.first), 0)
    for generation in range(1, search.generations):
        spread = np.maximum(elite.std(axis=0), _LEAST_SPREAD)
        elite = best_of(around(elite.mean(axis=0), spread, search.candidates), generation)
    # A candidate of few episodes may just have been lucky.
    again = successes(elite, FIRST_SEED + search.generations * search.episodes, 2 * search.episodes)
    return opponent_at(elite[int(np.argmin(again))], base)
