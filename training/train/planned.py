"""A policy that imitates the planner `mpc`: `python -m training.train.planned --out FOLDER`.

The planner waits for the strike, whenever it comes, and moves only as early as the robot's delay asks for;
so does what imitates it (`imitation`). PPO, which begins by moving as soon as the sword does, hardly finds
that. The result is a policy, and may be the teacher of `python -m training.train --teacher FOLDER`.
"""

from __future__ import annotations

import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import Final

import torch
from tqdm import tqdm

from mecanum_env.checkout import commit
from mecanum_env.cli import run
from mecanum_env.errors import require_at_least
from mecanum_env.files import write_json
from mecanum_env.outputs import output_folder
from mecanum_env.programs import Done
from training.controllers.policy import save_policy
from training.train.checkpoint import Point, about, versions, write_run
from training.train.imitation import Imitation
from training.train.run import DEVELOPMENT_SEEDS, development_score
from training.train.settings import Ppo, TrainingSenses, TrainingSettings

ROUNDS: Final = ((1.0, 0.3), (0.3, 0.2), (0.2, 0.15), (0.1, 0.1), (0.05, 0.1), (0.05, 0.05))
"""Share of the episodes that the planner drives, and standard deviation of the noise on actions, by round."""
_EPOCHS, _LAST_EPOCHS = 4, 24
"""Passes over all advice after each round, and after the last one."""
_FILES: Final = ("policy.npz", "curve.json", "run.json")


def epochs_of(number: int) -> int:
    """Return the number of passes over all advice after a round; rounds are counted from 1."""
    return _LAST_EPOCHS if number == len(ROUNDS) else _EPOCHS


def main(
    out: Path,
    model: Path | None = None,
    seed: int = 0,
    stack: int = 16,
    layers: tuple[int, ...] = (96, 96),
    steps: int = 144_000,
    envs: int = 48,
    senses: TrainingSenses = "mixed",
) -> Done:
    """Fit a policy to the planner's advice on drawn robots, against drawn opponents.

    Example: python -m training.train.planned --out out/planned

    Args:
        out: Folder to write: policy.npz, curve.json and run.json.
        model: Model file of the robot; by default the packaged one.
        seed: Seed of robots, episodes and weights.
        stack: Number of observations that the policy sees.
        layers: Units of each hidden layer.
        steps: Steps with advice, of all rounds and environments together.
        envs: Number of episodes side by side.
        senses: What the robot senses: off, usual, varied, or mixed (off and varied); the planner always sees
            through plain sensors.
    """
    require_at_least(1, steps=steps, envs=envs)
    settings = TrainingSettings(
        seed=seed,
        stack=stack,
        steps=steps,
        envs=envs,
        model=None if model is None else str(model),
        randomize="varied",
        opponents="varied",
        senses=senses,
        ppo=Ppo(layers=layers),
    )
    torch.set_num_threads(1)
    begun, begun_processor, scored_s = time.perf_counter(), time.process_time(), 0.0
    imitation, curve = Imitation(settings), []
    for number, (share, noise) in enumerate(tqdm(ROUNDS, desc="rounds", disable=None), start=1):
        imitation.collect(steps // len(ROUNDS), share, noise)
        imitation.fit(epochs_of(number))
        spent = time.perf_counter() - begun, time.process_time() - begun_processor - scored_s
        success, worst = development_score(imitation.network(), settings, DEVELOPMENT_SEEDS)
        scored_s += time.process_time() - begun_processor - scored_s - spent[1]
        curve.append(Point(number * (steps // len(ROUNDS)), success, worst, *spent))
    command = _command(out, model, settings)
    with output_folder(out, "training.train.planned", _FILES) as staged:
        save_policy(
            staged / "policy.npz",
            imitation.network(),
            {**about(settings, steps, [command]), "method": "imitation of the planner mpc"},
        )
        write_json(staged / "curve.json", [asdict(point) for point in curve])
        write_run(staged, settings, {"commands": [command], "versions": versions(), "commit": commit()})
    print("   steps  success  worst robot  minutes of the processor")
    for point in curve:
        print(f"{point.steps:8d}  {point.success:7.3f}  {point.worst:11.3f}  {point.processor_s / 60:7.1f}")
    print(f"\nwrote {out / 'policy.npz'}")
    return Done(wrote=[out / name for name in _FILES])


def _command(out: Path, model: Path | None, settings: TrainingSettings) -> str:
    """Return the command that fits the same policy."""
    words = ["python -m training.train.planned", f"--out {out}"]
    words += [] if model is None else [f"--model {model}"]
    words += [f"--seed {settings.seed}", f"--stack {settings.stack}"]
    words += ["--layers", *map(str, settings.ppo.layers)]
    words += [f"--steps {settings.steps}", f"--envs {settings.envs}", f"--senses {settings.senses}"]
    return " ".join(words)


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m training.train.planned"))
