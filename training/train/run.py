"""Training, from the settings to the exported policy, and going on after an interruption.

At each checkpoint all environments begin anew and every generator of random numbers is seeded from the run's
seed and the steps done. What follows a checkpoint thus hangs on nothing but the checkpoint and the settings:
a run that goes on from one ends with the same weights as one that was never interrupted, bit for bit.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize
from tqdm import tqdm

from mecanum_env.errors import InputError
from mecanum_env.model import write_model
from training.train.agent import make_agent
from training.train.checkpoint import (
    Point,
    State,
    begin_with,
    commands_before,
    newest_checkpoint,
    read_learner,
    read_run,
    read_state,
    write_checkpoint,
    write_run,
)
from training.train.environments import bare_env, model_of, seeds_at, training_env
from training.train.export import commit, network_of, versions
from training.train.settings import Settings, command_line
from training.train.watch import DEVELOPMENT_SEEDS, watch

_NEVER: Final = sys.maxsize


def train(
    settings: Settings,
    folder: Path,
    *,
    stop_after: int | None = None,
    watch_seeds: Sequence[int] = DEVELOPMENT_SEEDS,
    quiet: bool = False,
) -> State:
    """Train a policy into a new folder; return where the run ended.

    Args:
        settings: of the run.
        folder: to write; see `training.train.checkpoint`.
        stop_after: end at the first checkpoint after so many steps; `resume` goes on from there.
        watch_seeds: of the episodes that each checkpoint is tried on.
        quiet: whether to show no progress bar.

    Raises:
        InputError: the folder holds a run already, or the settings are not usable.
    """
    if (folder / "run.json").exists():
        raise InputError(
            f"{folder}: holds a training run; go on with --resume {folder}, or give another --out"
        )
    agent, normaliser = _beginner(settings)
    commands = [*commands_before(settings), command_line(settings, str(folder))]
    write_run(folder, settings, {"commands": commands, "versions": versions(), "commit": commit()})
    write_model(model_of(settings), folder / "model.json")
    told = _Told(settings, folder, commands, _NEVER if stop_after is None else stop_after, watch_seeds, quiet)
    return _learn(agent, normaliser, State(), told)


def resume(
    folder: Path,
    *,
    steps: int | None = None,
    stop_after: int | None = None,
    watch_seeds: Sequence[int] = DEVELOPMENT_SEEDS,
    quiet: bool = False,
) -> State:
    """Go on with the run of a folder, from its newest checkpoint; return where it ended.

    Args:
        folder: of the run.
        steps: train for so many in all instead of the run's own number; the learning rate then falls over
            these, so the result is not that of a run that had this number from its start.
        stop_after: end at the first checkpoint after so many steps.
        watch_seeds: of the episodes that each checkpoint is tried on.
        quiet: whether to show no progress bar.

    Raises:
        InputError: the folder holds no run, or one that is over.
    """
    settings, facts = read_run(folder)
    begun = any((folder / "checkpoints").glob("[0-9]*"))
    state = read_state(newest_checkpoint(folder)) if begun else State()
    wanted = settings.steps if steps is None else steps
    if state.steps_done >= wanted:
        raise InputError(f"{folder}: trained for {state.steps_done} steps already; give more with --steps")
    if wanted != settings.steps:
        settings = replace(settings, steps=wanted)
        write_run(folder, settings, facts)
    if begun:
        env = VecMonitor(bare_env(settings))
        agent, normaliser = read_learner(newest_checkpoint(folder), settings, env)
    else:
        # Interrupted before its first checkpoint: from the start, as it was begun.
        agent, normaliser = _beginner(settings)
    until = _NEVER if stop_after is None else stop_after
    told = _Told(settings, folder, facts["commands"], until, watch_seeds, quiet)
    return _learn(agent, normaliser, state, told)


def _beginner(settings: Settings) -> tuple[BaseAlgorithm, VecNormalize]:
    """Return learner and normaliser before the first step."""
    normaliser = training_env(settings)
    agent = make_agent(settings, normaliser)
    if settings.start is not None:
        begin_with(Path(settings.start), agent, normaliser)
    return agent, normaliser


@dataclass(frozen=True)
class _Told:
    settings: Settings
    folder: Path
    commands: Sequence[str]
    stop_after: int
    watch_seeds: Sequence[int]
    quiet: bool


class _Parts(BaseCallback):  # type: ignore[misc]
    """Writes a checkpoint and begins anew whenever enough steps are done."""

    def __init__(
        self, settings: Settings, state: State, save: Callable[[], None], stop_after: int, bar: tqdm[Any]
    ) -> None:
        super().__init__()
        self._settings, self._save, self._bar = settings, save, bar
        self._next = state.steps_done
        self._begun, self._stop_after = state.steps_done, stop_after
        self.stopped = False

    def _on_rollout_start(self) -> None:
        done = self.model.num_timesteps
        if done < self._next:
            return
        if done > self._begun:
            self._save()
            self.stopped = done >= self._stop_after
        if not self.stopped:
            _begin_part(self.model, self._settings)
            every = self._settings.checkpoint_every
            self._next = (done // every + 1) * every

    def _on_step(self) -> bool:
        self._bar.update(self.training_env.num_envs)
        return not self.stopped


def _learn(agent: BaseAlgorithm, normaliser: VecNormalize, state: State, told: _Told) -> State:
    settings, folder = told.settings, told.folder
    wall, processor = time.perf_counter() - state.wall_s, time.process_time() - state.processor_s
    now = [state]
    agent.set_logger(configure(str(folder / "tensorboard"), ["tensorboard"]))

    def save() -> None:
        nonlocal wall, processor
        spent = time.perf_counter() - wall, time.process_time() - processor
        seen = watch(network_of(agent, normaliser, settings), settings, told.watch_seeds)
        # Watching is no part of training, so the clocks stand meanwhile.
        wall, processor = time.perf_counter() - spent[0], time.process_time() - spent[1]
        point = Point(agent.num_timesteps, seen.success, seen.worst, *spent)
        now[0] = State(agent.num_timesteps, (*now[0].curve, point), *spent)
        agent.logger.record("watch/success", seen.success)
        agent.logger.record("watch/worst", seen.worst)
        bar.set_postfix_str(f"success {seen.success:.2f}")
        write_checkpoint(folder, agent, normaliser, settings, now[0], told.commands)

    with tqdm(
        total=settings.steps,
        initial=state.steps_done,
        unit="step",
        unit_scale=True,
        desc=settings.algo,
        disable=True if told.quiet else None,
    ) as bar:
        parts = _Parts(settings, state, save, told.stop_after, bar)
        # Something is there, so that `learn` does not reset what the first part resets.
        agent._last_obs = np.zeros((settings.envs, *normaliser.observation_space.shape), np.float32)
        left = settings.steps - agent.num_timesteps
        agent.learn(left, callback=parts, reset_num_timesteps=False)
        if not parts.stopped:
            save()
            agent.logger.dump(agent.num_timesteps)
    normaliser.close()
    return now[0]


def _begin_part(agent: BaseAlgorithm, settings: Settings) -> None:
    """Begin every episode anew and seed every generator from the settings and the steps done."""
    done = agent.num_timesteps
    every, ppo = settings.checkpoint_every, settings.ppo
    renewed = math.ceil(ppo.renewed_at * settings.steps / every)
    if settings.algo == "ppo" and 0 < done < settings.steps and done // every == renewed:
        agent.policy.spread_anew(ppo.renewed_log_std)
    seed = int(np.random.SeedSequence((settings.seed, done, 1)).generate_state(1)[0])
    set_random_seed(seed)
    agent.action_space.seed(seed)
    env = agent.get_env()
    native = env.unwrapped
    native._seeds = seeds_at(settings, done)
    agent._last_obs = env.reset()
    agent._last_episode_starts = np.ones(env.num_envs, bool)
    agent._last_original_obs = env.get_original_obs()
