"""Half of the recordings begin with the first command."""

from __future__ import annotations

import numpy as np

from sysid.studies.zoo.cases.beginning import as_recorded, begins_with_step

SEEDS = range(400)


def test_about_half_of_the_seeds_begin_with_a_step() -> None:
    assert 150 < sum(map(begins_with_step, SEEDS)) < 250


def test_only_the_rest_before_the_first_command_is_left_out() -> None:
    step = next(seed for seed in SEEDS if begins_with_step(seed))
    rest = next(seed for seed in SEEDS if not begins_with_step(seed))
    wheel, robot = np.array([0.0, 0.0, 5.0, 0.0, 3.0]), np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0]])
    never = np.zeros(3)
    found = as_recorded(step, [wheel, robot, never])
    for one, wanted in zip(found, (wheel[2:], robot[1:], never), strict=True):
        np.testing.assert_array_equal(one, wanted)
    for one, wanted in zip(as_recorded(rest, [wheel, robot]), (wheel, robot), strict=True):
        np.testing.assert_array_equal(one, wanted)
