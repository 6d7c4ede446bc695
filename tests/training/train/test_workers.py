"""Environments in several processes: the same rows, and a process that fails is told."""

import os
import signal
from dataclasses import dataclass, replace

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from mecanum_env.errors import InputError, MachineError
from training.controllers.policy import load_policy
from training.train.environments import Rows, bare_env, episode_seeds, native_envs, renew
from training.train.run import train_policy
from training.train.settings import Ppo, TrainingSettings
from training.train.workers import WorkersVecEnv

SETTINGS = TrainingSettings(
    steps=768,
    envs=12,
    workers=3,
    checkpoint_every=384,
    randomize="varied",
    opponents="varied",
    senses="mixed",
    stack=2,
    privileged="critic",
    ppo=Ppo(rollout_steps=16, batch_size=96, epochs=2, layers=(8,)),
)


def played(settings, steps=40):
    """Return observations, rewards, ends and last observations of random play, robots renewed half-way."""
    env = bare_env(settings)
    rng = np.random.default_rng(0)
    seen = []
    for done in (0, steps):
        renew(env, settings, done)
        env.unwrapped._seeds = episode_seeds(settings, done)
        seen.append(env.reset())
        for _ in range(steps):
            observation, reward, ended, infos = env.step(rng.uniform(-0.3, 0.3, (settings.envs, 3)))
            last = [infos[row]["terminal_observation"] for row in np.flatnonzero(ended)]
            seen += [observation, reward, ended, *last]
    env.close()
    return seen


def test_rows_are_the_same_in_any_number_of_processes():
    alone, shared = played(replace(SETTINGS, workers=1)), played(SETTINGS)
    assert len(alone) > 242  # episodes ended
    assert all(np.array_equal(a, b) for a, b in zip(alone, shared, strict=True))


def test_a_run_ends_with_the_same_weights_in_any_number_of_processes(tmp_path):
    for workers in (1, 2):
        settings = replace(SETTINGS, workers=workers)
        train_policy(settings, tmp_path / str(workers), development_seeds=range(2), quiet=True)
    one, two = (load_policy(tmp_path / name).network.weights for name in ("1", "2"))
    assert all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))


def test_some_rows_of_a_training_have_the_senses_that_they_have_in_all_of_it():
    sizes = [env.num_envs for env in native_envs(SETTINGS)]
    first, second = (native_envs(SETTINGS, 0, rows) for rows in (range(4), range(4, 12)))
    assert sizes == [6, 6]
    assert [(env.num_envs, env.arena.setting.senses is None) for env in first] == [(4, True)]
    assert [(env.num_envs, env.arena.setting.senses is None) for env in second] == [(2, True), (6, False)]


def test_the_death_of_a_process_is_told_with_its_rows():
    env = bare_env(SETTINGS)
    env.reset()
    os.kill(env._processes[1].pid, signal.SIGKILL)
    with pytest.raises(MachineError, match="environments 4 to 7 ended"):
        env.step(np.zeros((12, 3), np.float32))
    env.close()


@dataclass(frozen=True)
class Broken(Rows):
    """Rows that cannot be renewed."""

    def renew(self, env, steps_done):
        """Fail."""
        raise ValueError(f"{env.num_envs} rows have no robots after {steps_done}")


def test_an_error_in_a_process_is_the_cause_of_the_one_here():
    env = WorkersVecEnv([Broken(SETTINGS, range(2))])
    with pytest.raises(RuntimeError, match="a process with environments failed") as raised:
        env.renew(5)
    assert str(raised.value.__cause__) == "2 rows have no robots after 5"
    env.close()


@dataclass(frozen=True)
class Refused(Rows):
    """Rows whose robots are refused."""

    def renew(self, env, steps_done):
        """Refuse."""
        raise InputError(f"{env.num_envs} rows are refused after {steps_done}")


def test_a_refusal_in_a_process_is_one_here():
    env = WorkersVecEnv([Refused(SETTINGS, range(2))])
    with pytest.raises(InputError, match="2 rows are refused after 5"):
        env.renew(5)
    env.close()


def test_closing_ends_all_processes():
    env = bare_env(SETTINGS)
    processes = list(env._processes)
    env.close()
    assert len(processes) == 3
    assert all(process.exitcode is not None for process in processes)


def test_no_environment_is_here_to_be_asked_or_changed():
    env = bare_env(SETTINGS)
    assert env.get_attr("render_mode", [0, 3]) == [None, None]
    assert env.env_is_wrapped(str, [1]) == [False]
    for ask in (lambda: env.set_attr("x", 1), lambda: env.env_method("x")):
        with pytest.raises(NotImplementedError, match="in other processes"):
            ask()
    env.close()
