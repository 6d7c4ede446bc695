"""The Tankendo environments in figures: speed against bare physics, and what simple controllers reach.

Example: python benchmarks/env.py --out out/bench/env.json
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any, get_args

import mujoco
import numpy as np
from tqdm import tqdm

from mecanum_env.cli import run
from mecanum_env.files import write_json
from mecanum_env.kinematics import command_to_wheels
from mecanum_env.model import Model, paper_model, read_model
from mecanum_env.simulator import RobotPlant
from mecanum_env.simulator.robot import at_rest
from mecanum_env.tankendo import DIFFICULTIES, action_to_command
from mecanum_env.tankendo.env import TankendoEnv
from mecanum_env.tankendo.plant import compile_model
from mecanum_env.tankendo.vector import TankendoVectorEnv
from training.evaluate import Job, Setup, share

PLANTS = get_args(RobotPlant)
ROWS = {"planar": 256, "rollers": 32}
STEPS = {"planar": 8192, "rollers": 512}
TARGETS = {"planar": 20_000.0, "rollers": 650.0}
CONTROLLERS = ("random", "still", "retreat", "oracle")


@dataclass(frozen=True)
class Figure:
    """One measured number and what it should be; without a target it is for information."""

    name: str
    value: float
    unit: str
    low: float | None = None
    high: float | None = None

    @property
    def verdict(self) -> str:
        """Say ok or MISSED, or nothing where there is no target."""
        if self.low is None and self.high is None:
            return ""
        above = self.low is None or self.value >= self.low
        return "ok" if above and (self.high is None or self.value <= self.high) else "MISSED"

    @property
    def target(self) -> str:
        """Write the bound out."""
        return f">= {self.low:g}" if self.low is not None else f"<= {self.high:g}" if self.high else ""


def speed(model: Model, plant: RobotPlant, repeats: int) -> list[Figure]:
    """Measure env-steps per second, in rounds that alternate with bare `mj_step` of the same model."""
    rows, steps = ROWS[plant], STEPS[plant]
    runs = {
        "bare": _bare(model, plant),
        "single": _single(model, plant),
        "vector, 1 thread": _vector(model, plant, rows, 1),
        "vector, 2 threads": _vector(model, plant, rows, 2),
    }
    rates: dict[str, list[float]] = {name: [] for name in (*runs, "by the clock")}
    for _ in tqdm(range(repeats), desc=f"speed, {plant}", unit="round", disable=None):
        for name, run_steps in runs.items():
            wall, own = time.perf_counter(), time.process_time()
            run_steps(steps)
            wall, own = time.perf_counter() - wall, time.process_time() - own
            # One thread by its processor time, two by the clock, and what they are compared with too.
            rates[name].append(steps / (wall if name == "vector, 2 threads" else own))
            if name == "vector, 1 thread":
                rates["by the clock"].append(steps / wall)

    def ratio(one: str, other: str) -> float:
        return median(a / b for a, b in zip(rates[one], rates[other], strict=True))

    one, two = "vector, 1 thread", "vector, 2 threads"
    return [
        Figure(f"{plant}: bare mj_step, best", max(rates["bare"]), "env-steps/s"),
        Figure(f"{plant}: one environment, best", max(rates["single"]), "env-steps/s"),
        Figure(f"{plant}: one environment, time over bare - 1", ratio("bare", "single") - 1, "", high=0.05),
        Figure(f"{plant}: {rows} together, 1 thread, best", max(rates[one]), "env-steps/s", TARGETS[plant]),
        Figure(f"{plant}: {rows} together, time over bare - 1", ratio("bare", one) - 1, ""),
        Figure(
            f"{plant}: {rows} together, 2 threads over 1, best",
            max(rates[two]) / max(rates["by the clock"]),
            "",
            1.7,
        ),
    ]


def _bare(model: Model, plant: RobotPlant) -> Callable[[int], None]:
    """Step the physics alone through the commands that the environments get: rollers cost by their motion."""
    mj_model = compile_model(model, plant).mj_model
    data = at_rest(mj_model)
    substeps = round(model.wheel.command_period_s / mj_model.opt.timestep)
    wheels = command_to_wheels(*action_to_command(_actions(997), "cartesian").T)

    def steps_of(steps: int) -> None:
        for step in range(steps):
            data.ctrl[:] = wheels[step % len(wheels)]
            mujoco.mj_step(mj_model, data, nstep=substeps)

    return steps_of


def _single(model: Model, plant: RobotPlant) -> Callable[[int], None]:
    env = TankendoEnv(model=model, plant=plant)
    env.reset(seed=0)
    actions = _actions(997)

    def steps_of(steps: int) -> None:
        for step in range(steps):
            _, _, terminated, truncated, _ = env.step(actions[step % len(actions)])
            if terminated or truncated:
                env.reset()

    return steps_of


def _actions(*shape: int) -> np.ndarray[Any, np.dtype[np.float32]]:
    return np.random.default_rng(0).uniform(-0.3, 0.3, (*shape, 3)).astype(np.float32)


def _vector(model: Model, plant: RobotPlant, rows: int, threads: int) -> Callable[[int], None]:
    env = TankendoVectorEnv(rows, model=model, plant=plant, threads=threads, autoreset_mode="SameStep")
    env.reset(seed=0)
    actions = _actions(97, rows)

    def steps_of(steps: int) -> None:
        for step in range(steps // rows):
            env.step(actions[step % len(actions)])

    return steps_of


def scores(model: Model, plant: RobotPlant, episodes: int) -> list[dict[str, Any]]:
    """Play every controller on every level, one episode a seed; return successes with Wilson's interval."""
    rows = []
    jobs = [(name, level) for name in CONTROLLERS for level in DIFFICULTIES]
    for name, level in tqdm(jobs, desc=f"scores, {plant}", disable=None):
        played = Job(name, name, Setup(model, physics=plant, difficulty=level), episodes).play()
        success = share(sum(episode.success for episode in played.episodes), episodes)
        rows.append(
            {
                "controller": name,
                "plant": plant,
                "difficulty": level,
                "episodes": episodes,
                "success": success.value,
                "low": success.low,
                "high": success.high,
            }
        )
    return rows


def main(model: Path | None = None, out: Path | None = None, repeats: int = 7, episodes: int = 200) -> None:
    """Measure the environments of a model file and print the figures beside their targets.

    Args:
        model: the model file; by default the packaged one.
        out: also write the figures here, as JSON.
        repeats: rounds of the speed measurement.
        episodes: of each controller on each level and plant; 0: none.
    """
    chosen = paper_model() if model is None else read_model(model)
    figures = [figure for plant in PLANTS for figure in speed(chosen, plant, repeats)]
    width = max(len(figure.name) for figure in figures)
    for figure in figures:
        value = f"{figure.value:.4g} {figure.unit}"
        print(f"{figure.name:{width}}  {value:>20}  {figure.target:>9}  {figure.verdict}")
    played = [row for plant in PLANTS if episodes for row in scores(chosen, plant, episodes)]
    for row in played:
        print(
            f"{row['controller']:8} {row['plant']:8} {row['difficulty']:7} "
            f"{row['success']:.2f}  ({row['low']:.2f} .. {row['high']:.2f}) of {row['episodes']}"
        )
    if out is not None:
        rows = [{**asdict(figure), "verdict": figure.verdict} for figure in figures]
        write_json(out, {"mujoco": mujoco.__version__, "figures": rows, "scores": played})


if __name__ == "__main__":
    raise SystemExit(run(main, prog="python benchmarks/env.py"))
