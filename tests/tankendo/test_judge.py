"""The two rules, the ends of an episode, tracking and the duel."""

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.tankendo import Opponent, Rules, command_to_action
from mecanum_env.tankendo.constants import TECHNIQUES
from training.controllers import Proportional, Still

SHORT = tuple(replace(technique, reach_m=1.0) for technique in TECHNIQUES)
HARMLESS = Opponent(patience_s=(0.3, 0.3), feint_probability=0.0, drift_m_s=0.0, techniques=SHORT)
PEACEFUL = Opponent(patience_s=(99.0, 99.0), drift_m_s=0.0, walk_m_s=0.01)


class After:
    """Stands until a strike has missed, then sends one command."""

    def __init__(self, arena, row, command):
        self.arena, self.row, self.command = arena, row, command

    def reset(self):
        pass

    def act(self, observation):
        missed = np.isfinite(self.arena.judge.check_s[self.row])
        return self.command if missed else (0, 0, 0)


@pytest.mark.parametrize(
    ("command", "success"),
    [((0, 0, 0), True), ((80, 180, 0), False), ((0, 0, 60), False), ((20, 0, 0), True)],
)
def test_an_evasion_counts_only_back_at_maai_and_facing(play, command, success):
    last = play(lambda arena, row: After(arena, row, command), 6, opponent=HARMLESS)
    np.testing.assert_array_equal(last["is_success"], success)
    assert not last["hit"].any()


def test_the_judgement_is_a_second_after_the_strike(begin):
    arena = begin(opponent=HARMLESS)
    terminated = False
    while not terminated:
        step = arena.step(command_to_action([(0, 0, 0)]))
        terminated = step.terminated[0]
    due = arena.fighter.sword.land_s[0] + Rules().return_s
    assert 0.0 <= arena.time_s()[0] - due < arena.step_s


@pytest.mark.parametrize("task", ["dodge", "track", "duel"])
def test_leaving_the_field_ends_it(begin, task):
    arena = begin(task=task, opponent=PEACEFUL, rules=Rules(track_time_s=60.0))
    for _ in range(80):
        step = arena.step(command_to_action([(135, 180, 0)]))
        if step.terminated[0]:
            break
    assert step.info["reward_out"][0] == -1.0
    assert abs(arena.scenes.now[0, 0]) > 4.5
    assert not step.info["is_success"][0]


def test_a_clash_ends_it(begin):
    arena = begin(opponent=PEACEFUL)
    for _ in range(40):
        step = arena.step(command_to_action([(100, 0, 0)]))
        if step.terminated[0]:
            break
    assert step.info["reward_out"][0] == -1.0
    assert step.info["distance_m"][0] < Rules().clash_m


def test_tracking_is_a_success_for_who_keeps_maai(play):
    kept = play(lambda arena, row: Proportional(gain_per_s=4.0), 20, task="track")
    stood = play(lambda arena, row: Still(), 20, task="track")
    assert kept["is_success"].mean() >= 0.9
    assert stood["is_success"].mean() <= 0.1


def test_standing_still_loses_the_duel(play):
    last = play(lambda arena, row: Still(), 6, task="duel")
    np.testing.assert_array_equal(last["points_against"], 2)
    assert not last["is_success"].any()


def test_a_missed_strike_is_the_robots_chance(play):
    rules = Rules(own_reach_m=2.5)
    last = play(lambda arena, row: Proportional(), 6, task="duel", opponent=HARMLESS, rules=rules)
    np.testing.assert_array_equal(last["points"], 2)
    assert last["is_success"].all()


def test_who_is_out_of_reach_makes_no_point(play):
    rules = Rules(own_reach_m=0.5, duel_time_s=12.0)
    last = play(lambda arena, row: Still(), 4, task="duel", opponent=HARMLESS, rules=rules)
    np.testing.assert_array_equal(last["points"], 0)
    assert not last["is_success"].any()
