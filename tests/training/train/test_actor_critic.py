"""The actor that also predicts what its critic alone sees."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
import torch
from stable_baselines3.common.utils import obs_as_tensor

from mecanum_env.errors import InputError
from training.controllers.policy import load_network, load_policy
from training.train.agent import make_agent, network_of
from training.train.environments import episode_seeds, training_env
from training.train.privileged import PRIVILEGED
from training.train.run import resume, train_policy
from training.train.settings import Ppo, TrainingSettings

PREDICTING = TrainingSettings(
    steps=4096,
    envs=16,
    checkpoint_every=2048,
    randomize="varied",
    opponents="varied",
    privileged="critic",
    ppo=Ppo(rollout_steps=32, batch_size=256, epochs=4, layers=(16,), prediction_weight=0.5),
)
WATCH = range(100_000, 100_004)


@pytest.fixture
def env():
    """Environments with their first observations begun."""
    env = training_env(PREDICTING)
    env.unwrapped._seeds = episode_seeds(PREDICTING, 0)
    return env


def prediction_error(agent, seen):
    """Return the mean error of the prediction at observations, and that of predicting nothing."""
    with torch.no_grad():
        actor, _ = agent.policy.mlp_extractor(seen)
        unseen = seen[:, -PRIVILEGED:]
        wrong = torch.nn.functional.smooth_l1_loss(agent.policy.prediction_net(actor), unseen)
    return float(wrong), float(torch.nn.functional.smooth_l1_loss(torch.zeros_like(unseen), unseen))


def test_the_loss_falls_by_the_weighted_entropy_less_the_weighted_error(env):
    weighed = replace(PREDICTING, ppo=replace(PREDICTING.ppo, entropy_weight=0.1))
    agent = make_agent(weighed, env)
    assert agent.ent_coef == 1.0
    seen = obs_as_tensor(env.reset(), "cpu")
    actions = torch.zeros(16, 3)
    with torch.no_grad():
        _, chances, gain = agent.policy.evaluate_actions(seen, actions)
        chosen = agent.policy.get_distribution(seen)
    assert torch.allclose(chances, chosen.log_prob(actions))
    error, _ = prediction_error(agent, seen)
    expected = 0.1 * float(chosen.entropy().mean()) - 0.5 * error
    assert float(gain.mean()) == pytest.approx(expected, rel=1e-5)


def test_what_lowers_the_loss_teaches_the_actor_to_predict(env):
    agent = make_agent(PREDICTING, env)
    env.reset()
    rng = np.random.default_rng(0)
    played = np.concatenate([env.step(rng.uniform(-0.1, 0.1, (16, 3)))[0] for _ in range(40)])
    seen, unknown = (obs_as_tensor(rows, "cpu") for rows in np.array_split(played, 2))
    before, nothing = prediction_error(agent, unknown)
    for _ in range(300):
        _, _, gain = agent.policy.evaluate_actions(seen, torch.zeros(len(seen), 3))
        agent.policy.optimizer.zero_grad()
        (-gain.mean()).backward()
        agent.policy.optimizer.step()
    assert prediction_error(agent, unknown)[0] < 0.9 * min(before, nothing)


def test_a_robot_gets_no_prediction(env):
    agent = make_agent(PREDICTING, env)
    network = network_of(agent, env, PREDICTING)
    plain = replace(PREDICTING, ppo=replace(PREDICTING.ppo, prediction_weight=0.0))
    same = network_of(make_agent(plain, training_env(plain)), env, plain)
    assert [weight.shape for weight in network.weights] == [weight.shape for weight in same.weights]


def test_an_interrupted_run_that_predicts_ends_with_the_same_weights(tmp_path):
    train_policy(PREDICTING, tmp_path / "one", development_seeds=WATCH, quiet=True)
    train_policy(PREDICTING, tmp_path / "two", stop_after=2048, development_seeds=WATCH, quiet=True)
    resume(tmp_path / "two", development_seeds=WATCH, quiet=True)
    one, two = (load_policy(tmp_path / name).network.weights for name in ("one", "two"))
    assert all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))
    assert "--ppo.prediction-weight 0.5" in load_network(tmp_path / "one")[1]["commands"][0]


@pytest.mark.parametrize("privileged", ["none", "both"])
def test_an_actor_with_nothing_to_predict_is_refused(privileged):
    with pytest.raises(InputError, match="what only its critic sees; give privileged = critic"):
        replace(PREDICTING, privileged=privileged)
