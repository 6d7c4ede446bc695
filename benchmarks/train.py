"""Success of training over several seeds: after all steps, and how soon it exceeds the scripted retreat.

Example: python benchmarks/train.py --out out/bench/train.json

An interrupted benchmark continues where it was; finished runs are not trained again.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from tqdm import tqdm

from mecanum_env.checkout import commit
from mecanum_env.cli import run
from mecanum_env.files import write_json
from training.controllers.policy import Policy, load_policy
from training.evaluate import ControllerFactory, Setup, controller_factory, evaluate_controller, mean
from training.train import run as training
from training.train.checkpoint import newest_checkpoint, read_run, read_state, versions
from training.train.environments import model_of
from training.train.run import DEVELOPMENT_SEEDS
from training.train.settings import Algorithm, TrainingSettings

BUDGET_S = 600.0
"""Wall-clock time in which training should exceed the scripted retreat [s]."""
TARGET = 0.85
"""Required success after all steps."""


def trained(settings: TrainingSettings, folder: Path) -> list[dict[str, Any]]:
    """Train or resume until the run is over; return its learning curve."""
    if not (folder / "run.json").exists():
        state = training.train_policy(settings, folder)
    else:
        stored, _ = read_run(folder)
        if stored != settings:
            raise SystemExit(f"{folder}: trained with other settings; give another --out or remove it")
        newest = newest_checkpoint(folder)
        state = None if newest is None else read_state(newest)
        if state is None or state.steps_done < settings.steps:
            state = training.resume(folder)
    return [asdict(point) for point in state.curve]


def success(settings: TrainingSettings, factory: ControllerFactory, seeds: range) -> float:
    """Return the share of successes in the episodes with these seeds."""
    setup = Setup(model_of(settings), settings.plant, settings.task, settings.difficulty)
    return evaluate_controller(factory, setup, seeds).success.value


def show(algo: Algorithm, one: dict[str, Any]) -> None:
    """Print what came of one run of an algorithm."""
    passed = one["passed_retreat"]
    when = (
        f"passed retreat after {passed['steps']:,} steps, {passed['wall_s'] / 60:.1f} minutes "
        f"({passed['wall_s'] / BUDGET_S:.2f} of the budget; {passed['processor_s'] / 60:.1f} processor)"
        if passed
        else "did not pass retreat"
    )
    last = one["curve"][-1]
    print(
        f"{algo}, seed {one['seed']}: success {one['success']:.3f}; {when}; all {last['steps']:,} steps "
        f"{last['wall_s'] / 60:.1f} minutes ({last['processor_s'] / 60:.1f} processor)"
    )


def main(
    out: Path = Path("out/bench/train.json"),
    algo: Algorithm = "ppo",
    seeds: tuple[int, ...] = (0, 1, 2),
    steps: int = TrainingSettings.steps,
    checkpoint_every: int = 100_000,
    episodes: int = 500,
) -> None:
    """Train with several seeds and print their success.

    Args:
        out: JSON file to write; the runs are in a folder of the same name beside it.
        algo: ppo or sac.
        seeds: seeds of the runs.
        steps: number of steps of each run.
        checkpoint_every: steps between two points of the learning curve.
        episodes: number of episodes of the final evaluation, with the seeds 0, 1, ...
    """
    settings = TrainingSettings(algo=algo, steps=steps, checkpoint_every=checkpoint_every)
    baseline = controller_factory("retreat", model_of(settings))
    watched = success(settings, baseline, DEVELOPMENT_SEEDS)
    retreat = success(settings, baseline, range(episodes))
    runs: list[dict[str, Any]] = []
    over_seeds = None
    for seed in tqdm(seeds, desc="seeds", disable=None):
        folder = out.with_suffix("") / f"{algo}-{seed}"
        curve = trained(replace(settings, seed=seed), folder)
        policy = load_policy(folder / "policy.npz")
        final = success(settings, lambda *_, p=policy: Policy(p.network, p.about), range(episodes))
        passed = next((point for point in curve if point["success"] > watched), None)
        runs.append({"seed": seed, "success": final, "passed_retreat": passed, "curve": curve})
        over_seeds = mean([one["success"] for one in runs])
        write_json(
            out,
            {
                "algo": algo,
                "steps": steps,
                "episodes": episodes,
                "retreat": retreat,
                "retreat_on_development_seeds": watched,
                "success": None if over_seeds is None else asdict(over_seeds),
                "target": TARGET,
                "budget_s": BUDGET_S,
                "runs": runs,
                "versions": versions(),
                "commit": commit(),
            },
        )
    for one in runs:
        show(algo, one)
    if over_seeds is not None:
        verdict = "ok" if over_seeds.value >= TARGET else "MISSED"
        print(
            f"{algo}, mean of {over_seeds.count} seeds: {over_seeds.value:.3f} ({over_seeds.low:.3f} .. "
            f"{over_seeds.high:.3f}, bootstrap over seeds), >= {TARGET}  {verdict}; retreat {retreat:.3f}"
        )
    print(f"wrote {out}")


if __name__ == "__main__":
    raise SystemExit(run(main, prog="python benchmarks/train.py"))
