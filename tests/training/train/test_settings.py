"""Settings of a training: bad ones begin no run, and what a run meets is what they say."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
import torch

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.model import paper_model
from mecanum_env.senses import VariedSenses
from mecanum_env.tankendo import Opponents
from training.train.__main__ import main
from training.train.agent import make_agent
from training.train.checkpoint import State
from training.train.environments import bare_env, episode_seeds, training_env
from training.train.robots import level_models
from training.train.run import DEVELOPMENT_SEEDS
from training.train.settings import TrainingSettings, command_line, settings_from_json

SMALL = TrainingSettings(steps=384, envs=4, stack=2, checkpoint_every=128)


def test_bad_settings_are_refused(capsys):
    with pytest.raises(InputError, match=r'env = .*did you mean "MecanumTankendoDuel-v0"'):
        TrainingSettings(env="MecanumTankendoDual-v0")
    with pytest.raises(InputError, match="stack = 0, must be at least 1"):
        TrainingSettings(stack=0)
    with pytest.raises(InputError, match=r'no .stak. \(did you mean "stack"'):
        settings_from_json(asdict(TrainingSettings()) | {"stak": 1})
    assert run(main, []) == 2
    assert "--out FOLDER or --resume FOLDER" in capsys.readouterr().err
    assert run(main, ["--resume", "x", "--seed", "3"]) == 2
    assert "the run's own settings count" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--ppo.learning-rate", "-1"), "ppo.learning_rate = -1.0, must be a finite number of at least 0"),
        (("--ppo.last-learning-rate", "inf"), "ppo.last_learning_rate = inf, must be a finite number"),
        (("--ppo.batch-size", "0"), "ppo.batch_size = 0, must be at least 2"),
        (("--ppo.rollout-steps", "0"), "ppo.rollout_steps = 0, must be at least 1"),
        (("--ppo.rollout-steps", "1", "--envs", "1"), "a rollout must have at least 2 steps"),
        (("--ppo.layers", "8", "-3"), "ppo.layers = -3, must be at least 1"),
        (("--ppo.epochs", "-1"), "ppo.epochs = -1, must be at least 1"),
        (("--ppo.gamma", "2"), "ppo.gamma = 2.0, must be a number from 0 to 1"),
        (("--ppo.clip-range", "-1"), "ppo.clip_range = -1.0, must be a finite number of at least 0"),
        (("--ppo.log-std", "nan"), "ppo.log_std = nan, must be a finite number"),
        (("--sac.learning-rate", "nan"), "sac.learning_rate = nan, must be a finite number"),
        (("--sac.updates-a-step", "0"), "sac.updates_a_step = 0, must be at least 1"),
        (("--sac.buffer-size", "-1"), "sac.buffer_size = -1, must be at least 1"),
        (("--sac.layers", "0"), "sac.layers = 0, must be at least 1"),
        (("--reward-weights", "hit", "nan"), "reward_weights: hit = nan, must be a finite number"),
        (("--warning-s", "0.9", "0.3"), "must be two numbers of at least 0, the lower first"),
        (("--curriculum", "2"), "curriculum = 2.0, must be a number from 0 to 1"),
        (("--privileged", "critic", "--algo", "sac"), "only PPO has it"),
        (("--teacher", "robust", "--algo", "sac"), "only PPO has one"),
        (("--seed", "-1"), "seed = -1, must be from 0 to 4294967295"),
        (("--seed", str(2**32)), "seed = 4294967296, must be from 0 to 4294967295"),
    ],
)
def test_a_number_that_cannot_be_trained_with_begins_no_run(arguments, message, tmp_path, capsys):
    assert run(main, ["--out", str(tmp_path / "run"), *arguments]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(torch.cuda.is_available(), reason="this machine has a GPU")
def test_a_gpu_that_is_not_there_is_refused_before_a_run_begins(tmp_path, capsys):
    assert run(main, ["--out", str(tmp_path / "run"), "--device", "cuda"]) == 2
    assert "finds no GPU here; give cpu" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_the_networks_have_as_many_threads_as_the_settings_say():
    before = torch.get_num_threads()
    try:
        for threads in (2, 1):
            make_agent(replace(SMALL, threads=threads), training_env(SMALL))
            assert torch.get_num_threads() == threads
    finally:
        torch.set_num_threads(before)
    with pytest.raises(InputError, match="threads = 0, must be at least 1"):
        replace(SMALL, threads=0)


def test_levels_are_robots_side_by_side():
    settings = TrainingSettings(randomize="levels", envs=9, stack=2)
    env = training_env(settings)
    models = level_models(paper_model())
    assert len({json.dumps(model.effects, sort_keys=True, default=dict) for model in models.values()}) == len(
        models
    )
    natives = env.unwrapped.envs
    assert [native.num_envs for native in natives] == [2, 2, 2, 2, 1]
    env.unwrapped._seeds = episode_seeds(settings, 0)
    assert env.reset().shape == (9, 42)
    env.step(np.ones((9, 3), np.float32))
    one = [native.arena.robots.model_of(0) for native in natives]
    assert one == list(models.values())


def test_opponents_and_senses_can_be_varied_in_training():
    env = bare_env(replace(SMALL, opponents="varied", senses="varied"))
    setting = env.venv.envs[0].arena.setting
    assert (type(setting.opponents), type(setting.senses)) == (Opponents, VariedSenses)
    assert env.reset().shape == bare_env(SMALL).reset().shape


def test_training_never_meets_an_episode_of_an_evaluation():
    seeds = episode_seeds(TrainingSettings(envs=256), 0)
    assert len(set(seeds)) == 256
    assert min(seeds) > max(DEVELOPMENT_SEEDS)
    assert set(seeds).isdisjoint(episode_seeds(TrainingSettings(envs=256), 250_000))
    assert set(seeds).isdisjoint(episode_seeds(TrainingSettings(envs=256, seed=1), 0))


def test_a_run_names_the_command_that_repeats_it(tmp_path, monkeypatch):
    settings = replace(SMALL, seed=3, reward_weights={"hit": 2.0}, randomize="levels", time_to_cut=True)
    begun = []

    def begin(*given):
        begun.append(given)
        return State()

    monkeypatch.setattr("training.train.run.train_policy", begin)
    words = command_line(settings, str(tmp_path)).split()
    assert words[:3] == ["python", "-m", "training.train"]
    assert run(main, words[3:]) == 0
    assert begun == [(settings, tmp_path)]
