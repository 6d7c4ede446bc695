"""Time that a study of the gap takes with one and with two simulations at a time; their results must agree.

The bench study is of `examples/gap_logs`, in which two effects are hidden: it considers all single effects
and pairs, and triples of the best. The robot study is of eight runs of 5 s with different commands, made here
with roller friction and a turned sensor. The model of both is fitted to `examples/logs`. A bare replay
simulates every run of the logs once, in the same process.

    python benchmarks/gap.py --out out/benchmark_gap.json
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from mecanum_env.cli import run
from mecanum_env.files import write_json
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.prediction import Start, predict
from sysid.fit import fit_dataset, fitted_model
from sysid.gap.report.held_out import predicted
from sysid.gap.report.output import gap_json
from sysid.gap.result import GapOptions, GapReport
from sysid.gap.wording import verdict_sentence
from sysid.gap.workflow import analyse
from sysid.logs import BodyCommand, Dataset, Run, Split, read_dataset
from sysid.progress import seconds_of

EXAMPLES = Path(__file__).parents[1] / "examples"
WANTED_S = {"bench": 60.0, "robot": 240.0}
"""Longest wanted time of a study on two cores [s]."""
HIDDEN: dict[str, dict[str, float]] = {
    "roller_friction": {"torque_n_m": 0.06},
    "mount_yaw": {"angle_deg": 4.0},
}
"""Effect -> parameter -> value hidden in the robot logs."""
NOISE = {"speed_fl_rpm": 0.5, "speed_fr_rpm": 0.5, "speed_rl_rpm": 0.5, "speed_rr_rpm": 0.5,
         "vx_m_s": 0.005, "vy_m_s": 0.005, "yaw_rate_rad_s": 0.01}  # fmt: skip
"""Channel of the robot logs -> standard deviation of its noise, in the channel's unit."""
ROBOT_S, SAMPLE_S, COMMAND_S = 5.0, 0.02, 0.1
SPLITS: tuple[Split, ...] = ("fit", "fit", "fit", "fit", "validation", "validation", "test", "test")
Level = Literal["bench", "robot"]


def benchmark(levels: tuple[Level, ...] = ("bench", "robot"), seed: int = 0, out: Path | None = None) -> None:
    """Print seconds, their ratio to a bare replay, and whether one and two jobs give the same gap.json.

    Example: python benchmarks/gap.py --levels bench

    Args:
        levels: studies to time.
        seed: seed of the noise and of the studies.
        out: JSON file to write.
    """
    model = fitted_model(fit_dataset(read_dataset(EXAMPLES / "logs")))
    machine = f"{len(os.sched_getaffinity(0))} cores, load {os.getloadavg()[0]:.1f} before"
    print(machine)
    results = {}
    for level in levels:
        data = read_dataset(EXAMPLES / "gap_logs") if level == "bench" else robot_logs(model, seed)
        results[level] = study(data, model, seed)
        _print(level, results[level])
    if out is not None:
        write_json(
            out, {"format": "mecanum-benchmark-gap/1", "seed": seed, "machine": machine, "results": results}
        )


def study(dataset: Dataset, model: Model, seed: int) -> dict[str, Any]:
    """Return times and results of one study, done with one job and with two.

    The model lacks the effects that are in the dataset.
    """
    _, replay_s = seconds_of(lambda: predicted(model, dataset.runs))
    began = time.process_time()
    one, one_s = seconds_of(lambda: analyse(dataset, model, GapOptions(seed=seed, jobs=1)))
    one_cpu_s = time.process_time() - began
    two, two_s = seconds_of(lambda: analyse(dataset, model, GapOptions(seed=seed, jobs=2)))
    return {
        "runs": len(dataset.runs),
        "log_s": sum(run.duration_s for run in dataset.runs),
        "sets": len(one.evidence),
        "sentence": verdict_sentence(one),
        "replay_s": replay_s,
        "jobs_1_s": one_s,
        "jobs_1_cpu_s": one_cpu_s,
        "jobs_2_s": two_s,
        "best_over_replay": min(one_s, two_s) / replay_s,
        "speed_up": one_s / two_s,
        "equal": _written(one) == _written(two),
    }


def robot_logs(model: Model, seed: int) -> Dataset:
    """Return eight runs of 5 s, without repeats, of the model's robot with the effects of `HIDDEN`."""
    rng = np.random.default_rng(seed)
    truth = model
    for name, values in HIDDEN.items():
        truth = truth.with_effect(name, **values)
    runs = []
    for number, split in enumerate(SPLITS):
        plan = _run(f"drive_{number}.csv", split, _commands(rng))
        shown = predict(truth, plan, Start())
        logged = {
            name: shown[name] + sd * rng.standard_normal(shown[name].size) for name, sd in NOISE.items()
        }
        runs.append(replace(plan, channels=logged))
    return Dataset("robot, eight drives of 5 s", tuple(runs), ())


def _commands(rng: np.random.Generator) -> FloatArray:
    """Return V [rpm], theta [deg] and VC [rpm], one row per 0.1 s: rest, then ten held for 0.4 or 0.5 s."""
    v, theta, vc = rng.integers(10, 91, 10), 15 * rng.integers(-12, 13, 10), rng.integers(-30, 31, 10)
    rows = np.stack([v, theta, np.where(rng.random(10) < 0.5, 0, vc)], axis=1).astype(float)
    holds = rng.permutation(np.repeat([4, 5], 5))
    return np.concatenate([np.zeros((5, 3)), np.repeat(rows, holds, axis=0)])


def _run(file: str, split: Split, commands: FloatArray) -> Run:
    time_s = np.linspace(0.0, ROBOT_S, round(ROBOT_S / SAMPLE_S) + 1)
    rows = np.minimum(np.floor(time_s / COMMAND_S + 1e-6).astype(int), len(commands) - 1)
    empty = {name: np.zeros(time_s.size) for name in NOISE}
    return Run(file, file.removesuffix(".csv"), split, time_s, BodyCommand(*commands[rows].T), empty)


def _written(report: GapReport) -> bytes:
    """Return the bytes of the study's gap.json."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "gap.json"
        write_json(path, gap_json(report))
        return path.read_bytes()


def _print(level: Level, r: dict[str, Any]) -> None:
    print(f"\n{level}: {r['runs']} runs, {r['log_s']:.0f} s of log. {r['sentence']}")
    print(f"  one bare replay of all runs  {r['replay_s']:8.2f} s")
    print(f"  study, --jobs 1              {r['jobs_1_s']:8.2f} s, {r['jobs_1_cpu_s']:.2f} s of it computing")
    print(f"  study, --jobs 2              {r['jobs_2_s']:8.2f} s; {r['speed_up']:.2f} times as fast")
    print(f"  the faster over the replay   {r['best_over_replay']:8.1f} times")
    print(f"  wanted on two cores          {WANTED_S[level]:8.2f} s at most")
    print(f"  sets fitted by simulation    {r['sets']:8d}")
    print(f"  gap.json of both             {'equal' if r['equal'] else 'DIFFERENT'}, bit for bit")


if __name__ == "__main__":
    sys.exit(run(benchmark, prog="python benchmarks/gap.py"))
