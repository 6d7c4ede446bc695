"""Train a policy: `python -m training.train --out FOLDER`."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

from mecanum_env.cli import run
from mecanum_env.effects.definition import RobotPlant
from mecanum_env.errors import InputError, install_command
from mecanum_env.programs import Done
from mecanum_env.tankendo.actions import ActionMode
from training.train.settings import (
    Algorithm,
    Ppo,
    Sac,
    TrainingOpponents,
    TrainingRobots,
    TrainingSenses,
    TrainingSettings,
)


def main(
    out: Path | None = None,
    resume: Path | None = None,
    algo: Algorithm = TrainingSettings.algo,
    env: str = TrainingSettings.env,
    steps: int | None = None,
    seed: int = TrainingSettings.seed,
    plant: RobotPlant = TrainingSettings.plant,
    model: Path | None = None,
    difficulty: str = TrainingSettings.difficulty,
    randomize: TrainingRobots = TrainingSettings.randomize,
    opponents: TrainingOpponents = TrainingSettings.opponents,
    senses: TrainingSenses = TrainingSettings.senses,
    start: Path | None = None,
    envs: int = TrainingSettings.envs,
    action_mode: ActionMode = TrainingSettings.action_mode,
    stack: int = TrainingSettings.stack,
    checkpoint_every: int = TrainingSettings.checkpoint_every,
    reward_weights: dict[str, float] | None = None,
    ppo: Ppo = Ppo(),  # noqa: B008
    sac: Sac = Sac(),  # noqa: B008
) -> Done:
    """Train a policy with Stable-Baselines3 and write it with everything needed to train it again.

    Example: python -m training.train --out out/ppo --steps 2000000

    Args:
        out: Folder to write; a robot runs the policy.npz in it.
        resume: Folder of an interrupted run; only --steps may be given with it.
        algo: ppo or sac.
        env: Name of the environment.
        steps: Number of steps of all environments together; by default 2,000,000.
        seed: Seed of weights, episodes and actions.
        plant: planar, or rollers (much slower).
        model: Model file of the robot; by default the packaged one.
        difficulty: Difficulty of the opponent: easy, normal or hard.
        randomize: Robots to train on: none (the model), posterior (drawn from its uncertainty), or levels.
        opponents: Opponents to train against: level (that of the difficulty), or varied (drawn for each
            episode).
        senses: What the robot senses: off (plain sensors), usual (frames that get lost, and an estimator), or
            varied (worse ones, drawn for each episode).
        start: Folder of another run whose weights are the initial ones.
        envs: Number of environments side by side.
        action_mode: Meaning of an action: cartesian, polar or command.
        stack: Number of observations that the policy sees.
        checkpoint_every: Steps between two checkpoints.
        reward_weights: Weights of the reward by name; by default waiting 0.05 out 5.
        ppo: Hyperparameters of PPO.
        sac: Hyperparameters of SAC.
    """
    if importlib.util.find_spec("stable_baselines3") is None:
        raise InputError(f"training needs Stable-Baselines3: {install_command('train')}")
    from training.train import run as training

    given = TrainingSettings(
        algo=algo,
        env=env,
        seed=seed,
        plant=plant,
        model=None if model is None else str(model),
        difficulty=difficulty,
        opponents=opponents,
        senses=senses,
        randomize=randomize,
        start=None if start is None else str(start),
        envs=envs,
        action_mode=action_mode,
        stack=stack,
        checkpoint_every=checkpoint_every,
        ppo=ppo,
        sac=sac,
    )
    if reward_weights is not None:
        given = replace(given, reward_weights=reward_weights)
    if resume is not None:
        if out is not None or given != TrainingSettings():
            raise InputError("--resume FOLDER: the run's own settings count; give only --steps beside it")
        state, folder = training.resume(resume, steps=steps), resume
    elif out is None:
        raise InputError("--out FOLDER or --resume FOLDER must be given")
    else:
        if steps is not None:
            given = replace(given, steps=steps)
        state, folder = training.train_policy(given, out), out
    print("   steps  success  minutes  of the processor")
    for point in state.curve:
        minutes = f"{point.wall_s / 60:7.1f}  {point.processor_s / 60:7.1f}"
        print(f"{point.steps:8d}  {point.success:7.3f}  {minutes}")
    print(f"\nwrote {folder / 'policy.npz'}; watch with: tensorboard --logdir {folder}")
    return Done(wrote=[folder / "policy.npz", folder / "curve.json"])


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m training.train"))
