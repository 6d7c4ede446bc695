"""Benchmark of the batch of arrays and of the environments on it, as ratios measured in one run.

Example: python benchmarks/batch.py --out out/bench/batch.json

With --device cuda the arrays on a GPU are measured, too, by the clock.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from statistics import median
from typing import Any

import gymnasium
import mujoco
import numpy as np
from metric import Metric, metric_rows, print_metrics
from tqdm import tqdm

import mecanum_env
from mecanum_env.batch import PlanarBatch, planar_robot
from mecanum_env.cli import run
from mecanum_env.files import write_json
from mecanum_env.kinematics import command_to_wheels
from mecanum_env.model import Model, paper_model, read_model
from mecanum_env.simulator import RobotPlant
from mecanum_env.simulator.robot import at_rest
from mecanum_env.tankendo import action_to_command
from mecanum_env.tankendo.plant import RobotBatch, compile_model
from mecanum_env.tankendo.vector import TankendoVectorEnv

gymnasium.register_envs(mecanum_env)

ROWS = {"arrays": 4096, "mujoco": 256}
ON_DEVICE = (4096, 65536, 524288)
"""Numbers of robots on a device."""
DRAWN = {"robot.mass_kg": (18.0, 24.0), "effects.speed_gain.gain": (0.9, 1.0)}
"""Robots of the benchmark of drawn robots."""
Round = Callable[[], tuple[float, float]]
"""Plays a round; returns processor seconds per robot and command period, and the share spent in resets."""


def plant(robots: RobotBatch | PlanarBatch, steps: int) -> Round:
    """Return the round of a plant that is driven by random commands, some `steps` for each robot."""
    drawn = np.random.default_rng(0).uniform([-80, -180, -60], [80, 180, 60], (steps, robots.n, 3))
    commands = np.round(drawn)

    def play() -> tuple[float, float]:
        start = time.process_time()
        for command in commands:
            robots.step(command)
        return (time.process_time() - start) / (steps * robots.n), 0.0

    return play


def many(n: int, steps: int, **arguments: Any) -> Round:
    """Return the round of a vector environment of n robots with these arguments."""
    env = TankendoVectorEnv(n, autoreset_mode="Disabled", **arguments)
    env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-0.3, 0.3, (steps, n, 3)).astype(np.float32)

    def play() -> tuple[float, float]:
        start, resets = time.process_time(), 0.0
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if (terminated | truncated).any():
                begun = time.process_time()
                env.reset(options={"reset_mask": terminated | truncated})
                resets += time.process_time() - begun
        total = time.process_time() - start
        return total / (steps * n), resets / total

    # The episodes of the first rows end together; later ends are spread.
    play()
    return play


def one(steps: int, **arguments: Any) -> Round:
    """Return the round of a single environment from `gymnasium.make` with these arguments."""
    env = gymnasium.make("MecanumTankendo-v0", **arguments)
    env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-0.3, 0.3, (steps, 3)).astype(np.float32)

    def play() -> tuple[float, float]:
        start, resets = time.process_time(), 0.0
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                begun = time.process_time()
                env.reset()
                resets += time.process_time() - begun
        total = time.process_time() - start
        return total / steps, resets / total

    return play


def bare(model: Model, kind: RobotPlant, steps: int) -> Round:
    """Return the round of `mj_step` alone, with the model and the commands of `one` on this kind of plant."""
    mj_model = compile_model(model, kind).mj_model
    data = at_rest(mj_model)
    substeps = round(model.wheel.command_period_s / mj_model.opt.timestep)
    actions = np.random.default_rng(0).uniform(-0.3, 0.3, (steps, 3))
    wheels = command_to_wheels(*action_to_command(actions, "cartesian").T)

    def play() -> tuple[float, float]:
        start = time.process_time()
        for wheel in wheels:
            data.ctrl[:] = wheel
            mujoco.mj_step(mj_model, data, nstep=substeps)
        return (time.process_time() - start) / steps, 0.0

    return play


def on_device(robots: int, steps: int, device: str, chosen: Model) -> float:
    """Return the seconds, by the clock, per robot and command period of a plant on a device of torch."""
    batch = PlanarBatch(planar_robot(chosen), robots, device=device)
    drawn = np.random.default_rng(0).uniform([-80, -180, -60], [80, 180, 60], (steps, robots, 3))
    commands = np.round(drawn)
    batch.step(commands[0])  # the first step makes ready what torch needs
    batch.motion()
    start = time.perf_counter()
    for command in commands:
        batch.step(command)
        batch.motion()
    return (time.perf_counter() - start) / (steps * robots)


def measured(rounds: Mapping[str, Round], repeats: int) -> dict[str, tuple[list[float], list[float]]]:
    """Return the seconds and the shares of resets of all rounds by name, played in turn."""
    found: dict[str, tuple[list[float], list[float]]] = {name: ([], []) for name in rounds}
    for _ in tqdm(range(repeats), desc="speed", unit="round", disable=None):
        for name, play in rounds.items():
            seconds, share = play()
            found[name][0].append(seconds)
            found[name][1].append(share)
    return found


def main(
    model: Path | None = None, out: Path | None = None, repeats: int = 7, device: str | None = None
) -> None:
    """Measure the batch and the environments of a model file on one core; print ratios beside their targets.

    Args:
        model: the model file; by default the packaged one.
        out: also write the results to this file, as JSON.
        repeats: rounds of the measurement.
        device: also measure the plant on this device of torch, such as cuda.
    """
    chosen = paper_model() if model is None else read_model(model)
    arrays, rows = ROWS["arrays"], ROWS["mujoco"]
    found = measured(
        {
            "plant, mujoco": plant(RobotBatch(compile_model(chosen, "planar"), rows), 8),
            "plant, arrays": plant(PlanarBatch(planar_robot(chosen), arrays), 8),
            "many, mujoco": many(rows, 60, model=chosen),
            "many, arrays": many(arrays, 60, model=chosen, engine="arrays"),
            "many, arrays, drawn": many(512, 60, model=chosen, engine="arrays", randomize=DRAWN),
            "bare, planar": bare(chosen, "planar", 400),
            "one, planar": one(400, model=chosen),
            "one, planar, drawn": one(400, model=chosen, randomize=DRAWN),
            "bare, rollers": bare(chosen, "rollers", 40),
            "one, rollers": one(40, model=chosen, plant="rollers"),
            # About two episodes, so that most rounds have as many resets as others.
            "one, rollers, drawn": one(130, model=chosen, plant="rollers", randomize=DRAWN),
        },
        repeats,
    )

    def ratio(name: str, over: str) -> float:
        return median(a / b for a, b in zip(found[name][0], found[over][0], strict=True))

    def resets(name: str) -> float:
        return median(found[name][1])

    metrics = [
        Metric(
            f"plant: mujoco over arrays, {arrays} robots", ratio("plant, mujoco", "plant, arrays"), low=10
        ),
        Metric(f"environment: mujoco over arrays, {arrays}", ratio("many, mujoco", "many, arrays"), low=8),
        Metric("arrays: plant, best", 1 / min(found["plant, arrays"][0]), "env-steps/s"),
        Metric("arrays: environment, best", 1 / min(found["many, arrays"][0]), "env-steps/s"),
        Metric("arrays: share of resets", resets("many, arrays"), high=0.05),
        Metric("arrays: share of resets, drawn robots", resets("many, arrays, drawn"), high=0.05),
        Metric("mujoco, together: share of resets", resets("many, mujoco"), high=0.05),
        Metric("one environment over its engine, planar", ratio("one, planar", "bare, planar"), high=4),
        Metric("one environment over its engine, rollers", ratio("one, rollers", "bare, rollers"), high=1.15),
        Metric("one environment: share of resets", resets("one, planar"), high=0.05),
        Metric("one environment: share of resets, drawn", resets("one, planar, drawn"), high=0.05),
        Metric("one, rollers: share of resets, drawn", resets("one, rollers, drawn"), high=0.05),
    ]
    if device is not None:
        arrays_s = min(found["plant, arrays"][0])
        for robots in ON_DEVICE:
            taken_s = min(on_device(robots, 8, device, chosen) for _ in range(repeats))
            metrics += [
                Metric(f"plant on {device}, {robots} robots, best", 1 / taken_s, "env-steps/s"),
                Metric(f"plant on {device}, {robots} robots: over one core", arrays_s / taken_s),
            ]
    print_metrics(metrics)
    if out is not None:
        write_json(out, {"mujoco": mujoco.__version__, "figures": metric_rows(metrics)})


if __name__ == "__main__":
    raise SystemExit(run(main, prog="python benchmarks/batch.py"))
