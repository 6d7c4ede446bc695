"""Many evaluations at a time."""

import pytest

from mecanum_env.errors import InputError
from training.evaluate import Job, Setup, play_jobs


def test_each_job_is_played_and_told_of(paper):
    """That processes change nothing, the test of whole certificates shows."""
    jobs = {key: Job(key, "still", Setup(paper), count) for key, count in (("a", 1), ("b", 3), ("c", 2))}
    told = []
    one = play_jobs(jobs, 1, lambda name, count: told.append((name, count)))
    assert told == [("a", 1), ("b", 3), ("c", 2)]
    assert {key: len(found.episodes) for key, found in one.items()} == {"a": 1, "b": 3, "c": 2}


def test_a_controller_that_cannot_be_made_is_refused_at_once(paper):
    with pytest.raises(InputError, match="no such name"):
        play_jobs({"a": Job("a", "stil", Setup(paper), 1), "b": Job("b", "still", Setup(paper), 1)}, 2)
