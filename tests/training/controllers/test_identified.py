"""What `mpc` finds out about its robot while it drives, and how it waits."""

import numpy as np
import pytest

from mecanum_env.effects.apply import delayed
from mecanum_env.model import paper_model
from mecanum_env.tankendo import read_observation
from mecanum_env.tankendo.vector import TankendoVectorEnv
from training.controllers.identified_motion import IdentifiedPredictor
from training.controllers.interface import twist_command
from training.controllers.mpc import Mpc


def found(true, known, steps=12, speed_m_s=0.7):
    """Return the predictor of a `known` robot after the `true` one was driven to and fro."""
    env = TankendoVectorEnv(1, model=true, action_mode="command")
    observation, _ = env.reset(seed=100_000)
    predictor = IdentifiedPredictor(known)
    for step in range(steps):
        predictor.predict(read_observation(observation[0]))
        command = twist_command(0.0, speed_m_s * (-1) ** (step // 4), 0.0, known.robot)
        predictor.send(command)
        observation, *_ = env.step(np.array([command]) / (135.0, 180.0, 100.0))
    return predictor


@pytest.mark.parametrize("delay_s", [0.0, 0.05, 0.1, 0.15])
def test_the_delay_is_found_within_a_second(delay_s):
    true = delayed(paper_model(), delay_s) if delay_s else paper_model()
    assert found(true, paper_model()).command_s == pytest.approx(delay_s, abs=0.02)


def test_what_was_told_is_found_again():
    model = delayed(paper_model(), 0.1)
    predictor = found(model, model)
    assert predictor.command_s == pytest.approx(0.1, abs=0.02)
    assert predictor.share == pytest.approx([1.0, 1.0, 1.0], abs=0.1)


def test_a_robot_that_reaches_a_share_of_its_speed_is_found_out():
    slow = paper_model().with_effect("speed_gain", gain=0.8)
    predictor = found(slow, paper_model())
    assert predictor.share[:2] == pytest.approx([0.8, 0.8], abs=0.07)
    assert predictor.command_s < 0.04


def test_at_rest_it_believes_what_it_was_told():
    model = delayed(paper_model(), 0.1)
    predictor = found(model, model, speed_m_s=0.0)
    assert predictor.command_s == pytest.approx(0.1, abs=0.01)
    assert predictor.share == pytest.approx([1.0, 1.0, 1.0], abs=0.05)


def test_a_new_episode_is_a_new_robot():
    predictor = found(delayed(paper_model(), 0.15), paper_model())
    predictor.reset()
    assert predictor.command_s == 0.0
    assert predictor.share.tolist() == [1.0, 1.0, 1.0]


def test_it_waits_in_motion_that_is_still_an_opening():
    env = TankendoVectorEnv(1, action_mode="command")
    observation, _ = env.reset(seed=100_001)
    env.arena.chance.patience[:] = 99.0
    controller, speeds = Mpc(paper_model()), []
    for _ in range(40):
        command = controller.act(observation[0])
        observation, *_ = env.step(np.array([command]) / (135.0, 180.0, 100.0))
        speeds.append(np.hypot(*env.arena.scenes.now[3:5, 0]))
    assert 0.1 < np.mean(speeds[20:]) < 0.25
    assert env.arena.fighter.sees_opening(env.arena.fighter.seen())
