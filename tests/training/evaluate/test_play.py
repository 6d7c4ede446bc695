"""Episodes: one seed each, the same whatever plays beside them; why they fail; several jobs at a time."""

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.parallel import Workers
from mecanum_env.tankendo import Opponent, Rules, command_to_action
from mecanum_env.tankendo.env import TankendoEnv
from training.controllers.scripted import Still
from training.controllers.tracking import Proportional
from training.evaluate import Job, Setup, controller_factory, evaluate_controller, play_jobs


class Driving:
    """Sends one command forever, by default backwards."""

    def __init__(self, theta: int = 180, v: int = 130, vc: int = 0) -> None:
        self._command = (v, theta, vc)

    def reset(self) -> None:
        """Do nothing."""

    def act(self, _observation):
        """Return the command."""
        return self._command


@pytest.mark.parametrize("effect", [None, ("sensor_lowpass", {"time_constant_s": 0.1})])
def test_the_number_of_rows_changes_nothing(paper, echo, effect):
    model = paper if effect is None else paper.with_effect(effect[0], **effect[1])
    found = [evaluate_controller(echo, Setup(model), range(7), rows=rows) for rows in (1, 3, 7)]
    assert found[0] == found[1]
    assert found[0] == found[2]
    assert [episode.seed for episode in found[0].episodes] == list(range(7))


def test_drawn_robots_do_not_depend_on_the_rows(paper, echo):
    known = {"effects": {"speed_gain": {"gain": {"low": 0.6, "high": 1.0}}}}
    model = replace(paper.with_effect("speed_gain", gain=0.8), uncertainty=known)
    setup = Setup(model, randomize="posterior")
    one, many = (evaluate_controller(echo, setup, range(4), rows=rows) for rows in (1, 3))
    assert one == many
    assert one != evaluate_controller(echo, Setup(model), range(4))


def test_an_episode_is_that_of_the_single_environment(paper):
    found = evaluate_controller(controller_factory("retreat", paper), Setup(paper), [5]).episodes[0]
    env = TankendoEnv(model=paper, action_mode="command")
    observation, info = env.reset(seed=5)
    controller = controller_factory("retreat", paper)(env.arena, 0, 5)
    total, over, steps = 0.0, False, 0
    while not over:
        observation, reward, terminated, truncated, info = env.step(
            command_to_action(controller.act(observation))
        )
        total, over, steps = total + reward, terminated or truncated, steps + 1
    assert found.success == info["is_success"]
    assert found.total_reward == pytest.approx(total)
    assert found.duration_s == pytest.approx(0.1 * steps)
    assert found.warning_s == pytest.approx(info["warning_s"])
    assert found.technique == ("do", "nodo", "men", "kote")[info["technique"]]
    env.close()


def test_why_episodes_fail(paper):
    still = evaluate_controller(controller_factory("still", paper), Setup(paper), range(6))
    assert {episode.reason for episode in still.episodes} == {"hit"}
    away = evaluate_controller(lambda *_: Driving(), Setup(paper), range(3))
    assert {episode.reason for episode in away.episodes} == {"left the field"}
    ram = evaluate_controller(lambda *_: Proportional(distance_m=0.2), Setup(paper), range(3))
    assert {episode.reason for episode in ram.episodes} == {"clash"}
    patient = Setup(paper, opponent=Opponent(patience_s=(2.0, 3.0)))
    turned = evaluate_controller(lambda *_: Driving(0, 0, 60), patient, range(2))
    assert {episode.reason for episode in turned.episodes} == {"no opening"}
    idle = evaluate_controller(controller_factory("still", paper), Setup(paper, task="track"), range(3))
    assert {episode.reason for episode in idle.episodes} <= {"not kept", "clash"}
    assert all(episode.technique == "" and episode.warning_s is None for episode in idle.episodes)


def test_a_success_needs_no_reason(paper):
    kind = Opponent(warning_s=(0.6, 0.65), feint_probability=0.0)
    found = evaluate_controller(controller_factory("oracle", paper), Setup(paper, opponent=kind), range(3))
    assert [(episode.success, episode.reason) for episode in found.episodes] == [(True, "")] * 3
    assert all(0.6 <= episode.warning_s <= 0.65 for episode in found.episodes)


def test_times_are_measured_but_do_not_count_as_equal(paper):
    first, second = (evaluate_controller(lambda *_: Still(), Setup(paper), [0]) for _ in range(2))
    assert first == second
    assert first.command_times_s.size == round(first.episodes[0].duration_s / 0.1) // 5
    assert np.all(first.command_times_s > 0.0)
    assert first.episodes[0].command_time_s == pytest.approx(first.command_times_s.mean())


def test_a_named_controller_plays_by_the_rules_of_the_setup(paper):
    setup = Setup(paper, task="track", rules=Rules(maai_m=1.3))
    for name in ("lqr", "mpc"):
        errors = [
            one.distance_error_m
            for one in evaluate_controller(controller_factory(name, paper), setup, range(2)).episodes
        ]
        assert max(errors) < 0.3  # from the default maai of 1.7 m it is above 0.4


def test_no_episode_is_refused(paper):
    with pytest.raises(InputError, match="both must be at least 1"):
        evaluate_controller(controller_factory("still", paper), Setup(paper), [])


def test_each_job_is_played_and_reported(paper):
    """A test of certificates shows that the number of processes changes nothing."""
    jobs = {key: Job(key, "still", Setup(paper), count) for key, count in (("a", 1), ("b", 3), ("c", 2))}
    reported = []
    one = play_jobs(jobs, Workers(jobs=1), lambda name, count: reported.append((name, count)))
    assert reported == [("a", 1), ("b", 3), ("c", 2)]
    assert {key: len(found.episodes) for key, found in one.items()} == {"a": 1, "b": 3, "c": 2}


def test_a_controller_that_cannot_be_made_is_refused_at_once(paper):
    with pytest.raises(InputError, match="no such name"):
        play_jobs({name: Job(name, name, Setup(paper), 1) for name in ("stil", "still")}, Workers(jobs=2))
