"""Benchmark of the Tankendo environments: speed beside bare physics, and success of simple controllers.

Example: python benchmarks/env.py --out out/bench/env.json
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any, get_args

import mujoco
import numpy as np
import numpy.typing as npt
from metric import Metric, metric_rows, print_metrics
from tqdm import tqdm

from mecanum_env.cli import run
from mecanum_env.files import write_json
from mecanum_env.kinematics import command_to_wheels
from mecanum_env.model import Model, paper_model, read_model
from mecanum_env.simulator import RobotPlant
from mecanum_env.simulator.robot import at_rest
from mecanum_env.statistics import wilson_interval
from mecanum_env.tankendo import DIFFICULTIES, action_to_command
from mecanum_env.tankendo.env import TankendoEnv
from mecanum_env.tankendo.plant import compile_model
from mecanum_env.tankendo.vector import TankendoVectorEnv
from training.evaluate import Job, Setup

PLANTS = get_args(RobotPlant)
ROWS = {"planar": 256, "rollers": 32}
STEPS = {"planar": 8192, "rollers": 512}
TARGETS = {"planar": 20_000.0, "rollers": 650.0}
"""Environment steps per second of all rows on one thread."""
CONTROLLERS = ("random", "still", "retreat")
Steps = Callable[[int], None]
"""Function that makes a number of environment steps."""


def speed(model: Model, plant: RobotPlant, repeats: int) -> list[Metric]:
    """Measure environment steps per second, in rounds that alternate with bare `mj_step` of the model."""
    rows, steps = ROWS[plant], STEPS[plant]
    runs = {
        "bare": _bare(model, plant),
        "single": _single(model, plant),
        "1 thread": _vector(model, plant, rows, 1),
        "2 threads": _vector(model, plant, rows, 2),
    }
    cpu: dict[str, list[float]] = {name: [] for name in runs}
    wall: dict[str, list[float]] = {name: [] for name in runs}
    for _ in tqdm(range(repeats), desc=f"speed, {plant}", unit="round", disable=None):
        for name, make_steps in runs.items():
            wall_s, cpu_s = time.perf_counter(), time.process_time()
            make_steps(steps)
            wall[name].append(steps / (time.perf_counter() - wall_s))
            cpu[name].append(steps / (time.process_time() - cpu_s))

    def overhead(name: str) -> float:
        return median(bare / own for bare, own in zip(cpu["bare"], cpu[name], strict=True)) - 1

    # One thread is measured by its processor time, two by the clock.
    threads = max(wall["2 threads"]) / max(wall["1 thread"])
    best, unit = max(cpu["1 thread"]), "env-steps/s"
    return [
        Metric(f"{plant}: bare mj_step, best", max(cpu["bare"]), unit),
        Metric(f"{plant}: one environment, best", max(cpu["single"]), unit),
        Metric(f"{plant}: one environment, time over bare - 1", overhead("single"), high=0.05),
        Metric(f"{plant}: {rows} together, 1 thread, best", best, unit, TARGETS[plant]),
        Metric(f"{plant}: {rows} together, time over bare - 1", overhead("1 thread")),
        Metric(f"{plant}: {rows} together, 2 threads over 1, best", threads, low=1.7),
    ]


def _bare(model: Model, plant: RobotPlant) -> Steps:
    # With the environments' own commands: the cost of the rollers depends on the motion.
    mj_model = compile_model(model, plant).mj_model
    data = at_rest(mj_model)
    substeps = round(model.wheel.command_period_s / mj_model.opt.timestep)
    wheels = command_to_wheels(*action_to_command(_actions(997), "cartesian").T)

    def make_steps(steps: int) -> None:
        for step in range(steps):
            data.ctrl[:] = wheels[step % len(wheels)]
            mujoco.mj_step(mj_model, data, nstep=substeps)

    return make_steps


def _single(model: Model, plant: RobotPlant) -> Steps:
    env = TankendoEnv(model=model, plant=plant)
    env.reset(seed=0)
    actions = _actions(997)

    def make_steps(steps: int) -> None:
        for step in range(steps):
            _, _, terminated, truncated, _ = env.step(actions[step % len(actions)])
            if terminated or truncated:
                env.reset()

    return make_steps


def _vector(model: Model, plant: RobotPlant, rows: int, threads: int) -> Steps:
    env = TankendoVectorEnv(rows, model=model, plant=plant, threads=threads, autoreset_mode="SameStep")
    env.reset(seed=0)
    actions = _actions(97, rows)

    def make_steps(steps: int) -> None:
        for step in range(steps // rows):
            env.step(actions[step % len(actions)])

    return make_steps


def _actions(*shape: int) -> npt.NDArray[np.float32]:
    return np.random.default_rng(0).uniform(-0.3, 0.3, (*shape, 3)).astype(np.float32)


def scores(model: Model, plant: RobotPlant, episodes: int) -> list[dict[str, Any]]:
    """Play every controller on every level, one episode a seed; return successes with Wilson's interval."""
    rows = []
    jobs = [(name, level) for name in CONTROLLERS for level in DIFFICULTIES]
    for name, level in tqdm(jobs, desc=f"scores, {plant}", disable=None):
        played = Job(name, name, Setup(model, physics=plant, difficulty=level), episodes).play()
        successes = sum(episode.success for episode in played.episodes)
        low, high = wilson_interval(successes, episodes)
        row = {"controller": name, "plant": plant, "difficulty": level, "episodes": episodes}
        rows.append({**row, "success": successes / episodes, "low": low, "high": high})
    return rows


def main(model: Path | None = None, out: Path | None = None, repeats: int = 7, episodes: int = 200) -> None:
    """Measure the environments of a model file and print the results beside their targets.

    Args:
        model: the model file; by default the packaged one.
        out: also write the results to this file, as JSON.
        repeats: rounds of the speed measurement.
        episodes: episodes of each controller on each level and plant; 0: none.
    """
    chosen = paper_model() if model is None else read_model(model)
    metrics = [metric for plant in PLANTS for metric in speed(chosen, plant, repeats)]
    print_metrics(metrics)
    played = [row for plant in PLANTS if episodes for row in scores(chosen, plant, episodes)]
    for row in played:
        print(
            f"{row['controller']:8} {row['plant']:8} {row['difficulty']:7} "
            f"{row['success']:.2f}  ({row['low']:.2f} .. {row['high']:.2f}) of {row['episodes']}"
        )
    if out is not None:
        write_json(out, {"mujoco": mujoco.__version__, "figures": metric_rows(metrics), "scores": played})


if __name__ == "__main__":
    raise SystemExit(run(main, prog="python benchmarks/env.py"))
