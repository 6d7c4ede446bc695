"""Many evaluations, as many at a time as wanted, each in a process of its own; the result is the same."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from mecanum_env.errors import InputError
from training.evaluate.play import Evaluation, Setup, evaluate, named_maker

Progress = Callable[[str, int], Any]
"""Called with the name of a job that is done and the number of its episodes."""


@dataclass(frozen=True)
class Job:
    """Episodes to play, seeded 0, 1, ...; it can travel to another process."""

    name: str
    """For the progress bar."""
    controller: str
    """As for `training.controllers.named.make_controller`; it knows `setup.known`."""
    setup: Setup
    episodes: int

    def play(self) -> Evaluation:
        """Play them."""
        known = self.setup.model if self.setup.known is None else self.setup.known
        return evaluate(named_maker(self.controller, known), self.setup, range(self.episodes))


def play_jobs(
    jobs: Mapping[str, Job], at_a_time: int = 0, progress: Progress | None = None
) -> dict[str, Evaluation]:
    """Return what comes of each job, under its key.

    The first one is played alone: a controller that cannot be made is refused before any process starts, and
    the time that it takes for a command is measured with nothing else of this program under way.

    Args:
        jobs: at least one.
        at_a_time: processes; 0: as many as there are processors.
        progress: called after each.

    Raises:
        InputError: a negative number of processes, or as `evaluate`, for the first job that fails.
    """
    require_jobs(at_a_time)
    at_a_time = min(at_a_time or os.cpu_count() or 1, len(jobs))
    played: dict[str, Evaluation] = {}

    def done(key: str, evaluation: Evaluation) -> None:
        played[key] = evaluation
        if progress is not None:
            progress(jobs[key].name, jobs[key].episodes)

    first, *others = jobs
    done(first, jobs[first].play())
    if at_a_time == 1:
        for key in others:
            done(key, jobs[key].play())
        return played
    with _pool(at_a_time) as pool:
        # The slow ones first, so that the processes end together.
        order = sorted(others, key=lambda key: (jobs[key].setup.physics != "rollers", -jobs[key].episodes))
        waiting = {pool.submit(jobs[key].play): key for key in order}
        for future in as_completed(waiting):
            done(waiting[future], future.result())
    return played


def require_jobs(jobs: int) -> None:
    """Refuse a number of jobs at a time that is none.

    Raises:
        InputError: it is negative.
    """
    if jobs < 0:
        raise InputError(f"jobs = {jobs}, must be at least 0 (0: as many as there are processors)")


@contextmanager
def _pool(jobs: int) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool whose waiting work is dropped when the program is interrupted."""
    pool = ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn"))
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)
