"""The opponents that a planner expects that is told none."""

import numpy as np
import pytest

from mecanum_env.model import paper_model
from mecanum_env.tankendo import Opponent, command_to_action
from mecanum_env.tankendo.vector import TankendoVectorEnv
from training.controllers import Mpc
from training.controllers.expected import expected_opponents, miss_probability
from training.controllers.strike import RobotStates


def robots(x_m: float, vy_m_s: float) -> RobotStates:
    """Return a robot ahead of the opponent that faces it and goes sideways."""
    return RobotStates(*(np.array([number]) for number in (x_m, 0.0, np.pi, 0.0, vy_m_s)))


def test_they_differ_in_lead_and_reach_and_one_of_them_is_met():
    expected = expected_opponents(Opponent(sight_delay_s=0.17))
    assert sum(one.probability for one in expected) == pytest.approx(1.0)
    assert {one.opponent.lead_form for one in expected} == {"adaptive", "constant_velocity", "none"}
    assert len({one.opponent.extra_reach_m for one in expected}) == 2
    assert {one.opponent.sight_delay_s for one in expected} == {0.17}
    assert len({one.opponent.techniques for one in expected}) == 1


def test_going_on_sideways_evades_those_alone_that_do_not_lead():
    """A robot that keeps its velocity is where an opponent that leads by all of it aims."""
    seen, landed = robots(1.7, 1.0), robots(1.7, 1.0)
    landed.y[:] = Opponent().sight_delay_s + Opponent().techniques[0].swing_s
    expected = expected_opponents(Opponent())
    origin, at_rest = np.zeros(2), np.zeros(2)
    missed = miss_probability(expected, np.array([0]), origin, seen, landed, at_rest, 0.03)
    without = sum(one.probability for one in expected if one.opponent.lead_form == "none")
    assert missed == pytest.approx(without, abs=0.01)


def test_a_planner_that_is_told_none_wins_more_where_the_opponent_does_not_lead():
    """One that believed in the adaptive lead alone would win fewer of the same episodes."""

    def won(opponent: Opponent | None) -> int:
        met = Opponent(lead_form="none")
        env = TankendoVectorEnv(
            100, autoreset_mode="Disabled", action_mode="command", engine="arrays", opponent=met
        )
        seen, _ = env.reset(seed=list(range(100_000, 100_100)))
        planners = [Mpc(paper_model(), opponent=opponent) for _ in range(env.num_envs)]
        over, successes = np.zeros(env.num_envs, bool), 0
        while not over.all():
            commands = [planner.act(one) for planner, one in zip(planners, seen, strict=True)]
            step = env.arena.step(command_to_action(commands))
            seen, ended = step.observation, (step.terminated | step.truncated) & ~over
            successes += int(np.sum(env.arena.succeeded & ended))
            over |= ended
        return successes

    assert won(None) > won(Opponent())
