"""What a policy needs to meet late and unknown robots: history, memory, a privileged critic, a teacher.

Example: python benchmarks/learning.py --teacher out/teacher --out out/bench/learning.json

Every way is trained with the same seeds for the same steps on drawn robots, opponents and senses, and scored
on held-out rows of the certificate. The recurrent policy is sb3-contrib's, which must be installed:
`pip install sb3-contrib`. Finished runs are not trained again.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.files import write_json
from mecanum_env.model import paper_model
from mecanum_env.reading import read_json
from mecanum_env.tankendo import opponent_for
from mecanum_env.tankendo.vector import TankendoVectorEnv
from training.certify.variations import certificate_variants
from training.controllers.policy import features, load_policy
from training.evaluate import mean
from training.train.environments import episode_seeds, training_env
from training.train.run import train_policy
from training.train.score import successes
from training.train.settings import Ppo, TrainingSettings

ROWS: Final = ("nominal", "latency+0.1s", "late-and-slow", "sluggish", "quick", "deliberate", "long-armed")
"""Rows of the certificate that are played."""
_BASE: Final = TrainingSettings(
    randomize="varied",
    opponents="varied",
    senses="mixed",
    curriculum=0.0,
    margin_weight=0.7,
    envs=256,
    checkpoint_every=10_000_000,
    ppo=Ppo(epochs=8, entropy_weight=0.003, renewed_at=1.0),
)
WAYS: Final[Mapping[str, TrainingSettings]] = {
    "2 observations": replace(_BASE, stack=2),
    "6 observations": replace(_BASE, stack=6),
    "6, privileged critic": replace(_BASE, stack=6, privileged="critic"),
    "6, privileged critic, teacher": replace(_BASE, stack=6, privileged="critic"),
    "recurrent, 1 observation": replace(_BASE, stack=1),
}
"""What is compared; the teacher and the recurrent learner are added by name."""

Wins = Callable[[range, Mapping[str, Any]], float]
"""Share of successes in the episodes with these seeds, in an environment with these arguments."""


def rows(wins: Wins, episodes: int) -> dict[str, float]:
    """Return the success on each of `ROWS`."""
    found = {}
    for one in certificate_variants(paper_model(), "planar", opponent_for("normal")):
        if one.name in ROWS:
            given = {"model": one.model, "opponent": one.opponent, "senses": one.senses, "engine": "arrays"}
            found[one.name] = wins(range(episodes), given)
    return found


def feed_forward(settings: TrainingSettings, folder: Path, episodes: int) -> dict[str, Any]:
    """Train with these settings into a folder; return the success on each row and the processor time."""
    state = train_policy(settings, folder, quiet=True)
    network = load_policy(folder).network
    return {
        "success": rows(lambda seeds, given: float(successes(network, seeds, **given).mean()), episodes),
        "processor_s": state.processor_s,
    }


def recurrent(settings: TrainingSettings, episodes: int) -> dict[str, Any]:
    """Train sb3-contrib's recurrent PPO with these settings; return the same."""
    import torch
    from sb3_contrib import RecurrentPPO

    torch.set_num_threads(1)
    env = training_env(settings)
    ppo, begin = settings.ppo, time.process_time()
    env.unwrapped._seeds = episode_seeds(settings, 0)
    agent = RecurrentPPO(
        "MlpLstmPolicy",
        env,
        learning_rate=lambda left: (
            ppo.last_learning_rate + (ppo.learning_rate - ppo.last_learning_rate) * left
        ),
        n_steps=ppo.rollout_steps,
        batch_size=ppo.batch_size,
        n_epochs=ppo.epochs,
        gamma=ppo.gamma,
        ent_coef=ppo.entropy_weight,
        seed=settings.seed,
        device="cpu",
        policy_kwargs={
            "lstm_hidden_size": 64,
            "net_arch": list(ppo.layers),
            "log_std_init": ppo.log_std,
        },
    )
    agent.learn(settings.steps)
    spent = time.process_time() - begin

    def wins(seeds: range, given: Mapping[str, Any]) -> float:
        native = TankendoVectorEnv(len(seeds), autoreset_mode="Disabled", **given)
        observation, _ = native.reset(seed=list(seeds))
        won, over, state = np.zeros(len(seeds), bool), np.zeros(len(seeds), bool), None
        while not over.all():
            seen = env.normalize_obs(features(observation))
            action, state = agent.predict(seen, state, np.zeros(len(seeds), bool), deterministic=True)
            step = native.arena.step(action)
            observation, ended = step.observation, step.terminated | step.truncated
            won |= step.info["is_success"] & ended & ~over
            over |= ended
        return float(won.mean())

    return {"success": rows(wins, episodes), "processor_s": spent}


def main(
    out: Path = Path("out/bench/learning.json"),
    teacher: Path | None = None,
    seeds: tuple[int, ...] = (0, 1, 2),
    steps: int = 600_000,
    episodes: int = 200,
    ways: tuple[str, ...] = tuple(WAYS),
) -> None:
    """Compare ways to learn for late and unknown robots.

    Args:
        out: JSON file to write; the runs are in a folder of the same name beside it.
        teacher: Folder of a run with --privileged both, which the way with a teacher imitates for two thirds
            of the steps.
        seeds: Seeds of the runs.
        steps: Number of steps of each run.
        episodes: Number of episodes of each row, with the seeds 0, 1, ...
        ways: What is compared.
    """
    results: dict[str, dict[str, Any]] = read_json(out) if out.exists() else {}
    for way in ways:
        for seed in seeds:
            if str(seed) in results.get(way, {}):
                continue
            settings = replace(WAYS[way], seed=seed, steps=steps)
            folder = out.with_suffix("") / f"{way.replace(', ', '-').replace(' ', '-')}-{seed}"
            if way.startswith("recurrent"):
                found = recurrent(settings, episodes)
            elif way.endswith("teacher"):
                if teacher is None:
                    raise InputError("--teacher: none is given; train one with --privileged both")
                taught = replace(settings, teacher=str(teacher), teacher_steps=2 * steps // 3)
                found = feed_forward(replace(taught, ppo=replace(taught.ppo, log_std=-1.5)), folder, episodes)
            else:
                found = feed_forward(settings, folder, episodes)
            results.setdefault(way, {})[str(seed)] = found
            write_json(out, results)
    print(f"{'way, ' + str(steps) + ' steps':32}{'mean':>22}  " + "  ".join(f"{row:>13}" for row in ROWS))
    for way, runs in results.items():
        shares = {row: [one["success"][row] for one in runs.values()] for row in ROWS}
        over = mean([float(np.mean(list(one["success"].values()))) for one in runs.values()])
        minutes = np.mean([one["processor_s"] for one in runs.values()]) / 60.0
        cells = "  ".join(f"{np.mean(shares[row]):13.2f}" for row in ROWS)
        text = "-" if over is None else f"{over.value:.2f} ({over.low:.2f} .. {over.high:.2f})"
        print(f"{way:32}{text:>22}  {cells}  {minutes:.1f} processor minutes")
    print(f"wrote {out}")


if __name__ == "__main__":
    raise SystemExit(run(main, prog="python benchmarks/learning.py"))
