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
    Device,
    Ppo,
    PrivilegedTo,
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
    latency_s: tuple[float, float] = TrainingSettings.latency_s,
    opponents: TrainingOpponents = TrainingSettings.opponents,
    warning_s: tuple[float, float] = TrainingSettings.warning_s,
    first_warning_s: tuple[float, float] = TrainingSettings.first_warning_s,
    curriculum: float = TrainingSettings.curriculum,
    senses: TrainingSenses = TrainingSettings.senses,
    privileged: PrivilegedTo = TrainingSettings.privileged,
    teacher: str | None = None,
    teacher_steps: int = TrainingSettings.teacher_steps,
    start: Path | None = None,
    envs: int = TrainingSettings.envs,
    workers: int = TrainingSettings.workers,
    threads: int = TrainingSettings.threads,
    device: Device = TrainingSettings.device,
    action_mode: ActionMode = TrainingSettings.action_mode,
    stack: int = TrainingSettings.stack,
    time_to_cut: bool = TrainingSettings.time_to_cut,
    checkpoint_every: int = TrainingSettings.checkpoint_every,
    reward_weights: dict[str, float] | None = None,
    margin_weight: float = TrainingSettings.margin_weight,
    ppo: Ppo = Ppo(),  # noqa: B008
    sac: Sac = Sac(),  # noqa: B008
) -> Done:
    """Train a policy with Stable-Baselines3 and write it with everything needed to train it again.

    Example: python -m training.train --out out/ppo --steps 2000000

    On robots that are late and slow, against opponents of all kinds: python -m training.train --out out/late
    --randomize varied --opponents varied --senses mixed --stack 6 --privileged critic
    --ppo.prediction-weight 10. docs/training.md tells what each option is worth, and a quicker way for such
    robots, python -m training.train.planned.

    Args:
        out: Folder to write; a robot runs the policy.npz in it, which is that of the best checkpoint.
        resume: Folder of an interrupted run; only --steps may be given with it.
        algo: ppo or sac.
        env: Name of the environment.
        steps: Number of steps of all environments together; by default 2,000,000.
        seed: Seed of weights, episodes and actions.
        plant: planar, or rollers (much slower).
        model: Model file of the robot; by default the packaged one.
        difficulty: Difficulty of the opponent: easy, normal or hard.
        randomize: Robots to train on: none (the model), posterior (drawn from its uncertainty), levels (five
            side by side), or varied (drawn from its uncertainty, late and slow).
        latency_s: Range of the extra latency of varied robots [s].
        opponents: Opponents to train against: level (that of the difficulty), or varied (drawn for each
            episode).
        warning_s: Range of the warning time of varied opponents [s].
        first_warning_s: The same at the beginning of the curriculum.
        curriculum: Share of the steps over which the first range becomes the last.
        senses: What the robot senses: off (plain sensors), usual (frames that get lost, and an estimator),
            varied (worse ones, drawn for each episode), or mixed (half off, half varied).
        privileged: Who sees the true robot and opponent: none, critic, or both (critic and actor), for a
            teacher that no robot can run.
        teacher: A policy to imitate at first: a file, the folder of a run, or the name of a bundled policy.
        teacher_steps: Number of steps for which it is imitated.
        start: Folder of another run whose weights are the initial ones.
        envs: Number of environments side by side.
        workers: Number of processes that simulate them; the weights do not depend on it.
        threads: Number of threads of the networks on the processor; the weights depend on it.
        device: Where the networks learn: cpu, or cuda.
        action_mode: Meaning of an action: cartesian, polar or command.
        stack: Number of observations that the policy sees.
        time_to_cut: Let it also see how long the sword will still rise, as computed from its tip.
        checkpoint_every: Steps between two checkpoints.
        reward_weights: Weights of the reward by name; by default waiting 0.05 out 5.
        margin_weight: Weight of the margin by which a strike misses, in the reward.
        ppo: Hyperparameters of PPO.
        sac: Hyperparameters of SAC.
    """
    if importlib.util.find_spec("stable_baselines3") is None:
        raise InputError(f"training needs Stable-Baselines3: {install_command('train')}")
    from training.train.run import train_or_resume

    given = TrainingSettings(
        algo=algo,
        env=env,
        seed=seed,
        plant=plant,
        model=None if model is None else str(model),
        difficulty=difficulty,
        randomize=randomize,
        latency_s=latency_s,
        opponents=opponents,
        warning_s=warning_s,
        first_warning_s=first_warning_s,
        curriculum=curriculum,
        senses=senses,
        privileged=privileged,
        teacher=teacher,
        teacher_steps=teacher_steps,
        start=None if start is None else str(start),
        envs=envs,
        workers=workers,
        threads=threads,
        device=device,
        action_mode=action_mode,
        stack=stack,
        time_to_cut=time_to_cut,
        checkpoint_every=checkpoint_every,
        margin_weight=margin_weight,
        ppo=ppo,
        sac=sac,
    )
    if reward_weights is not None:
        given = replace(given, reward_weights=reward_weights)
    state, folder = train_or_resume(given, steps, out, resume)
    print(state.table)
    print(f"\nwrote {folder / 'policy.npz'}; watch with: tensorboard --logdir {folder}")
    return Done(wrote=[folder / "policy.npz", folder / "curve.json"])


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m training.train"))
