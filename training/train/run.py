"""Training from the settings to the exported policy, and resuming after an interruption.

At each checkpoint all environments begin anew, and every random generator is seeded from the run's seed and
the number of steps done. What follows a checkpoint thus depends on nothing but the checkpoint and the
settings: a resumed run ends with the same weights as an uninterrupted one, bit for bit.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import VecNormalize
from tqdm import tqdm

from mecanum_env.checkout import commit
from mecanum_env.errors import InputError
from mecanum_env.model import write_model
from mecanum_env.outputs import lock_folder
from training.controllers.policy import Network, load_network
from training.train.agent import make_agent, network_of, teacher_path
from training.train.checkpoint import (
    Point,
    Run,
    State,
    export_best,
    load_weights,
    newest_checkpoint,
    read_learner,
    read_run,
    read_state,
    versions,
    write_checkpoint,
    write_run,
)
from training.train.environments import (
    engine_for,
    episode_seeds,
    model_of,
    opponents_of,
    renew,
    senses_of,
    training_env,
)
from training.train.robots import level_models
from training.train.score import successes, successes_of_robots
from training.train.settings import TrainingSettings, command_line
from training.train.taught import TaughtPpo

DEVELOPMENT_SEEDS: Final = range(100_000, 100_400)
"""Seeds of the episodes that a run scores its policy on. Choices are made on these; final results are not."""


def train_or_resume(
    settings: TrainingSettings, steps: int | None, out: Path | None, resumed: Path | None
) -> tuple[State, Path]:
    """Train into the new folder `out`, or go on with the run in the folder `resumed`: exactly one is given.

    Returns:
        The state at the end, and the folder. None for `steps` means those of the settings, or of the run.

    Raises:
        InputError: both folders or none are given, settings are given for a run that has its own, or as of
            `train_policy` and `resume`.
    """
    if resumed is not None:
        if out is not None or settings != TrainingSettings():
            raise InputError("--resume FOLDER: the run's own settings count; give only --steps beside it")
        return resume(resumed, steps=steps), resumed
    if out is None:
        raise InputError("--out FOLDER or --resume FOLDER must be given")
    return train_policy(settings if steps is None else replace(settings, steps=steps), out), out


def train_policy(
    settings: TrainingSettings,
    folder: Path,
    *,
    stop_after: int | None = None,
    development_seeds: Sequence[int] = DEVELOPMENT_SEEDS,
    quiet: bool = False,
) -> State:
    """Train a policy into a new folder; return the state at the end.

    Args:
        settings: settings of the run.
        folder: folder to write; see `training.train.checkpoint`.
        stop_after: stop at the first checkpoint after this many steps; `resume` continues from there.
        development_seeds: seeds of the episodes that each checkpoint is scored on.
        quiet: show no progress bar.

    Raises:
        InputError: the folder already holds a run, or the settings cannot be used.
    """
    if (folder / "run.json").exists():
        raise InputError(
            f"{folder}: holds a training run; continue it with --resume {folder}, or give another --out"
        )
    learner = _new_learner(settings)
    before = [] if settings.start is None else read_run(Path(settings.start))[1]["commands"]
    if settings.teacher is not None:
        # The student's command needs the teacher that these commands train.
        taught_by = load_network(teacher_path(settings.teacher))[1].get("commands", [])
        before = [*(command for command in taught_by if command not in before), *before]
    commands = [*before, command_line(settings, str(folder))]
    folder.mkdir(parents=True, exist_ok=True)
    with lock_folder(folder):
        write_model(model_of(settings), folder / "model.json")
        # Last, since it makes the folder one to resume.
        write_run(folder, settings, {"commands": commands, "versions": versions(), "commit": commit()})
        run = Run(settings, folder, commands, *learner, State())
        return _learn(run, development_seeds, stop_after, quiet)


def resume(
    folder: Path,
    *,
    steps: int | None = None,
    development_seeds: Sequence[int] = DEVELOPMENT_SEEDS,
    quiet: bool = False,
) -> State:
    """Continue the run in a folder from its newest checkpoint; return the state at the end.

    Args:
        folder: folder of the run.
        steps: total number of steps, instead of the run's own; the learning rate then falls over this number,
            so the result differs from that of a run that had it from the start.
        development_seeds: seeds of the episodes that each checkpoint is scored on.
        quiet: show no progress bar.

    Raises:
        InputError: the folder holds no run, or a finished one.
    """
    settings, facts = read_run(folder)
    with lock_folder(folder):
        return _go_on(folder, settings, facts, steps, development_seeds, quiet)


def _go_on(
    folder: Path,
    settings: TrainingSettings,
    facts: dict[str, Any],
    steps: int | None,
    development_seeds: Sequence[int],
    quiet: bool,
) -> State:
    export_best(folder)
    newest = newest_checkpoint(folder)
    state = State() if newest is None else read_state(newest)
    wanted = settings.steps if steps is None else steps
    if state.steps_done >= wanted:
        raise InputError(f"{folder}: already trained for {state.steps_done} steps; give more with --steps")
    if wanted != settings.steps:
        settings = replace(settings, steps=wanted)
        write_run(folder, settings, facts)
    learner = _new_learner(settings) if newest is None else read_learner(newest, settings)
    return _learn(Run(settings, folder, facts["commands"], *learner, state), development_seeds, None, quiet)


def development_score(
    network: Network, settings: TrainingSettings, seeds: Sequence[int]
) -> tuple[float, float]:
    """Return the share of successes: over all robots and senses that are trained on, and on the worst one.

    Of several robots those of `level_models` are drawn, and play against the opponents of the training's end.
    """
    model = model_of(settings)
    kinds = senses_of(settings)
    played = []
    for start, senses in enumerate(kinds):
        own = seeds[start :: len(kinds)]
        arguments: dict[str, Any] = {
            "plant": settings.plant,
            "task": settings.task,
            "difficulty": settings.difficulty,
            "opponent": opponents_of(settings, settings.steps),
            "senses": senses,
            "engine": engine_for(model, settings.plant),
        }
        if not own:
            continue
        if settings.randomize in ("levels", "varied"):
            robots = list(level_models(model).values())
            played += successes_of_robots(network, own, robots, **arguments)
        else:
            drawn = "posterior" if settings.randomize == "posterior" else "none"
            played.append(successes(network, own, model=model, randomize=drawn, **arguments))
    return float(np.mean(np.concatenate(played))), min(float(np.mean(won)) for won in played)


def _new_learner(settings: TrainingSettings) -> tuple[BaseAlgorithm, VecNormalize]:
    """Return learner and normaliser before the first step."""
    normaliser = training_env(settings)
    agent = make_agent(settings, normaliser)
    if isinstance(agent, TaughtPpo):
        agent.begin_as(normaliser)
    if settings.start is not None:
        load_weights(Path(settings.start), agent, normaliser)
    return agent, normaliser


class _Checkpoints(BaseCallback):  # type: ignore[misc]
    """Writes a checkpoint and begins anew whenever enough steps are done."""

    def __init__(self, run: Run, seeds: Sequence[int], stop_after: int | None, bar: tqdm[Any]) -> None:
        super().__init__()
        self._run, self._seeds, self._bar = run, seeds, bar
        self._next = self._begun = run.state.steps_done
        self._stop_after = sys.maxsize if stop_after is None else stop_after
        self.stopped = False
        self._start_clocks(run.state.wall_s, run.state.processor_s)

    def _start_clocks(self, wall_s: float, processor_s: float) -> None:
        self._wall, self._processor = time.perf_counter() - wall_s, time.process_time() - processor_s

    def save(self) -> None:
        """Score the policy on the development seeds and write a checkpoint."""
        run, agent = self._run, self._run.agent
        spent = time.perf_counter() - self._wall, time.process_time() - self._processor
        network = network_of(agent, run.normaliser, run.settings)
        success, worst = development_score(network, run.settings, self._seeds)
        # Scoring does not count as training time.
        self._start_clocks(*spent)
        point = Point(agent.num_timesteps, success, worst, *spent)
        run.state = State(point.steps, (*run.state.curve, point), *spent, int(agent._n_updates))
        agent.logger.record("watch/success", success)
        agent.logger.record("watch/worst", worst)
        self._bar.set_postfix_str(f"success {success:.2f}")
        write_checkpoint(run)

    def _on_rollout_start(self) -> None:
        done = self.model.num_timesteps
        if done < self._next:
            return
        if done > self._begun:
            self.save()
            self.stopped = done >= self._stop_after
        if not self.stopped:
            _begin_anew(self.model, self._run.settings)
            every = self._run.settings.checkpoint_every
            self._next = (done // every + 1) * every

    def _on_step(self) -> bool:
        self._bar.update(self.training_env.num_envs)
        return not self.stopped


def _learn(run: Run, seeds: Sequence[int], stop_after: int | None, quiet: bool) -> State:
    settings, agent = run.settings, run.agent
    agent.set_logger(configure(str(run.folder / "tensorboard"), ["tensorboard"]))
    with tqdm(
        total=settings.steps,
        initial=run.state.steps_done,
        unit="step",
        unit_scale=True,
        desc=settings.algo,
        disable=True if quiet else None,
    ) as bar:
        checkpoints = _Checkpoints(run, seeds, stop_after, bar)
        # With a last observation `learn` does not reset the environments; `_begin_anew` does.
        agent._last_obs = np.zeros((settings.envs, *run.normaliser.observation_space.shape), np.float32)
        agent.learn(settings.steps - agent.num_timesteps, callback=checkpoints, reset_num_timesteps=False)
        if not checkpoints.stopped:
            checkpoints.save()
            agent.logger.dump(agent.num_timesteps)
    run.normaliser.close()
    return run.state


def _begin_anew(agent: BaseAlgorithm, settings: TrainingSettings) -> None:
    """Begin new episodes and seed every generator from the settings and the steps done."""
    done = agent.num_timesteps
    every, ppo = settings.checkpoint_every, settings.ppo
    renewed = math.ceil(ppo.renewed_at * settings.steps / every)
    if settings.algo == "ppo" and 0 < done < settings.steps and done // every == renewed:
        agent.policy.reset_std(ppo.renewed_log_std)
    seed = int(np.random.SeedSequence((settings.seed, done, 1)).generate_state(1)[0])
    set_random_seed(seed)
    agent.action_space.seed(seed)
    env = agent.get_env()
    if settings.opponents == "varied" or settings.randomize == "varied":
        # Other opponents and robots from here on.
        renew(env, settings, done)
    env.unwrapped._seeds = episode_seeds(settings, done)
    agent._last_obs = env.reset()
    agent._last_episode_starts = np.ones(env.num_envs, bool)
    agent._last_original_obs = env.get_original_obs()
