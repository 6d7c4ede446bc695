"""How well the generated robot moves: ratio to ideal kinematics, bounce, drift, energy; simulation speed.

Example: python benchmarks/physics.py --out out/physics.json
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import mujoco
import numpy as np
from metric import Metric, metric_rows, print_metrics
from mujoco.batch import Batch
from tqdm import tqdm

from mecanum_env.batch.runs import PlanarDrives
from mecanum_env.cli import run
from mecanum_env.files import write_json
from mecanum_env.kinematics import command_to_wheels
from mecanum_env.mjcf import TRAINING_TIMESTEP_S, planar_spec, robot_spec
from mecanum_env.mjcf.geometry import sideways_ratio
from mecanum_env.model import Model, paper_model, read_model
from mecanum_env.simulator import BodyCommands, compile_plant, drive
from sysid.studies.motion import (
    coast_energy,
    follow,
    heading_drift_rad,
    largest_rise,
    paper_like_commands,
    path_difference,
    random_commands,
    start,
    steady_drive,
    warnings_of,
)

FORWARD, LEFT, DIAGONAL, TURN, MIXED = (80, 0, 0), (80, 90, 0), (80, 45, 0), (0, 0, 80), (60, 30, 30)
NAMES = {FORWARD: "forward", LEFT: "left", DIAGONAL: "diagonal", TURN: "turn", MIXED: "60 rpm, 30 deg, VC 30"}


def motion(model: Model) -> list[Metric]:
    """Measure ratios to ideal kinematics, bounce, drift, dependence on the time step, and energy."""
    robot = model.robot
    rollers = robot_spec(model).compile()
    planar = planar_spec(model).compile()
    metrics = []
    for command, name in NAMES.items():
        steady = steady_drive(rollers, robot, command)
        bounds = steady.expected_ratio * 0.99, steady.expected_ratio * 1.01
        metrics.append(Metric(f"{name}: ratio to ideal kinematics", steady.ratio, "", *bounds))
        bound = 50.0 if command == FORWARD else None
        metrics.append(Metric(f"{name}: bounce, rms", steady.bounce_m * 1e6, "um", high=bound))
        metrics.append(Metric(f"{name}: the same, planar", steady_drive(planar, robot, command).ratio, ""))
    metrics.append(Metric("sinc(pi/N)", sideways_ratio(robot.rollers_per_wheel), ""))
    for theta in (0, 180, 90, 45, 135, -45, -135):
        drift = abs(np.rad2deg(heading_drift_rad(rollers, (80, theta, 0))))
        bound = 0.5 if theta in (0, 180) else 1.0
        metrics.append(Metric(f"drift of heading over 3 m at {theta} deg", float(drift), "deg", high=bound))
    coarse, fine = (robot_spec(model, step).compile() for step in (TRAINING_TIMESTEP_S, 1 / 960))
    for kind, commands in (("held 0.2 and 0.8 s", paper_like_commands), ("new every 0.1 s", _white)):
        steps, plants = [], []
        for driven in map(commands, range(5)):
            path = follow(fine, driven)
            steps.append(path_difference(path, follow(coarse, driven)))
            plants.append(path_difference(path, follow(planar, driven)))
        bound = 1.0 if commands is paper_like_commands else None
        name = f"10 s of random commands {kind}"
        metrics.append(
            Metric(f"{name}: 1/240 s against 1/960 s, worst of 5", max(steps) * 100, "% of path", high=bound)
        )
        metrics.append(Metric(f"{name}: planar against rollers, worst of 5", max(plants) * 100, "% of path"))
    rises = [largest_rise(coast_energy(rollers, command)) for command in NAMES]
    metrics.append(Metric("energy gained in free coast, worst of 5", max(rises) * 1e3, "mJ", high=20.0))
    return metrics


def _white(seed: int) -> list[tuple[float, tuple[float, float, float]]]:
    return [(0.1, command) for command in random_commands(100, seed)]


def endurance(model: Model, minutes: float) -> list[Metric]:
    """Drive random commands for some minutes; count MuJoCo's warnings and non-finite positions."""
    mj_model = robot_spec(model).compile()
    data = start(mj_model)
    substeps = round(0.1 / mj_model.opt.timestep)
    for command in tqdm(
        random_commands(round(minutes * 600), 0, 100, 60), desc="endurance", unit="command", disable=None
    ):
        data.ctrl[:] = command_to_wheels(*command)
        mujoco.mj_step(mj_model, data, nstep=substeps)
    bad = sum(warnings_of(data).values()) + int(not np.all(np.isfinite(data.qpos)))
    return [Metric(f"{minutes:g} min of random commands: warnings", float(bad), "", 0.0, 0.0)]


def speed(model: Model, repeats: int) -> list[Metric]:
    """Measure steps per second, by turns, so that a busy machine slows all runs alike.

    One thread is timed by its processor time, two by the clock. The robot has no visual geoms, as in
    training:
    moving them takes half of a planar step.
    """
    rollers = robot_spec(model, visuals=False).compile()
    planar = planar_spec(model, visuals=False).compile()
    floating = robot_spec(model, visuals=False).compile()
    floating.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    floating.opt.gravity[:] = 0.0
    models = {"rollers": rollers, "floating": floating, "planar": planar}
    runs = {name: _stepper(mj_model) for name, mj_model in models.items()}
    batches = {threads: _batch_stepper(rollers, threads) for threads in (1, 2)}
    rates: dict[str, list[float]] = {name: [] for name in (*runs, "batch 1", "batch 2")}
    for _ in tqdm(range(repeats), desc="speed", unit="round", disable=None):
        for name, run_steps in runs.items():
            rates[name].append(_rate(run_steps, 2400, time.process_time))
        for threads, run_steps in batches.items():
            rates[f"batch {threads}"].append(_rate(run_steps, 2400, time.perf_counter))

    def ratios(one: str, other: str) -> list[float]:
        return [a / b for a, b in zip(rates[one], rates[other], strict=True)]

    scaling = ratios("batch 2", "batch 1")
    contacts = median(ratios("rollers", "floating"))
    return [
        Metric("rollers, best", max(rates["rollers"]), "steps/s"),
        Metric("planar, best", max(rates["planar"]), "steps/s"),
        Metric("rollers over the same without contacts, median", contacts, low=0.4),
        Metric("planar over rollers, median", median(ratios("planar", "rollers")), ""),
        Metric("Batch of 8 on 2 threads over 1, best", max(scaling), "", 1.7),
        Metric("Batch of 8 on 2 threads over 1, median", median(scaling), ""),
        Metric(
            "drive of 5 s on the planar plant: the plugin's library over MuJoCo", _library(model), "", 10.0
        ),
    ]


def _library(model: Model) -> float:
    """Return how many times as fast as MuJoCo the plugin's library moves the planar plant, in the median."""
    compiled = compile_plant(model, "planar", TRAINING_TIMESTEP_S)
    drives, commands = PlanarDrives(model, TRAINING_TIMESTEP_S), BodyCommands.constant(60, 30, 20)

    def seconds(work: Callable[[], object]) -> float:
        begin = time.process_time()
        for _ in range(20):
            work()
        return time.process_time() - begin

    def ratio() -> float:
        there = seconds(lambda: drive(model, commands, 5.0, plant="planar", mj_model=compiled))
        return there / seconds(lambda: drives.drive(commands, 5.0))

    return median(ratio() for _ in range(5))


def _stepper(mj_model: mujoco.MjModel) -> Callable[[int], None]:
    data = mujoco.MjData(mj_model)
    data.ctrl[:] = command_to_wheels(60, 30, 20)
    mujoco.mj_step(mj_model, data, nstep=480)
    return lambda steps: mujoco.mj_step(mj_model, data, nstep=steps)


def _batch_stepper(mj_model: mujoco.MjModel, threads: int) -> Callable[[int], None]:
    batch = Batch(mj_model, nsim=8, nthread=threads)
    batch.ctrl = np.tile(command_to_wheels(60, 30, 20), (8, 1))
    batch.step(nstep=480)
    return lambda steps: batch.step(nstep=steps // 8)


def _rate(run_steps: Callable[[int], None], steps: int, clock: Callable[[], float]) -> float:
    begin = clock()
    run_steps(steps)
    return steps / (clock() - begin)


def main(model: Path | None = None, out: Path | None = None, minutes: float = 1.0, repeats: int = 15) -> None:
    """Measure the robot of a model file; print each metric beside its target.

    Args:
        model: the model file; by default the packaged one.
        out: JSON file to write.
        minutes: length of the drive that looks for warnings; an hour takes about one minute.
        repeats: rounds of the speed measurement.
    """
    chosen = paper_model() if model is None else read_model(model)
    metrics = [*motion(chosen), *endurance(chosen, minutes), *speed(chosen, repeats)]
    print_metrics(metrics)
    if out is not None:
        write_json(out, {"mujoco": mujoco.__version__, "figures": metric_rows(metrics)})


if __name__ == "__main__":
    raise SystemExit(run(main, prog="python benchmarks/physics.py"))
