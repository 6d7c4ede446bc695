"""What a study of the gap costs: now and in an earlier version, with one and with two simulations at a time.

Three studies, all of a model fitted to `examples/logs`:

- bench: `examples/gap_logs`, in which two effects are hidden.
- robot: eight runs of 5 s with different commands, made here with roller friction and a turned sensor.
- recording: twelve minutes of the same robot, in twelve runs of a minute.

The earlier version is checked out beside this one and its plugin compiled; both study the same files in
processes of their own, in turn, and their processor time is compared. Results of one and two jobs must agree.

    python benchmarks/gap.py --out out/benchmark_gap.json

The first two take a quarter of an hour, the recording with the version before the stations an hour.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any, Literal

import numpy as np

from mecanum_env.cli import run
from mecanum_env.errors import MecanumError
from mecanum_env.files import write_json
from mecanum_env.markdown import markdown_table
from mecanum_env.model import Model, write_model
from mecanum_env.units import FloatArray
from sysid.compare.measured import Start
from sysid.compare.predicted import predict
from sysid.fit import fit_dataset, fitted_model
from sysid.logs import BodyCommand, Dataset, Run, Split, read_dataset
from sysid.logs.writer import write_dataset

ROOT = Path(__file__).resolve().parents[1]
BEFORE_STATIONS = "d56090a1017e38328224d2186980912f98b95254"
"""The last version whose drive was one fixed formula, simulated by MuJoCo alone."""
HIDDEN: dict[str, dict[str, float]] = {
    "roller_friction": {"torque_n_m": 0.06},
    "mount_yaw": {"angle_deg": 4.0},
}
"""Effect -> parameter -> value hidden in the robot logs."""
NOISE = {"speed_fl_rpm": 0.5, "speed_fr_rpm": 0.5, "speed_rl_rpm": 0.5, "speed_rr_rpm": 0.5,
         "vx_m_s": 0.005, "vy_m_s": 0.005, "yaw_rate_rad_s": 0.01}  # fmt: skip
"""Channel of the robot logs -> standard deviation of its noise, in the channel's unit."""
SAMPLE_S, COMMAND_S = 0.02, 0.1
Level = Literal["bench", "robot", "recording"]
WANTED_S: dict[Level, float] = {"bench": 5.0, "robot": 60.0, "recording": 180.0}
"""Longest wanted processor time of a study [s]."""
WANTED_RATIO: dict[Level, str] = {"bench": "8", "robot": "4", "recording": "-"}
"""Wanted ratio of the processor time of the version before the stations to the present one's."""
ROUNDS: dict[Level, int] = {"bench": 2, "robot": 1, "recording": 1}
"""How often each version does a study; the median counts."""
SPLITS: dict[Level, tuple[Split, ...]] = {
    "robot": ("fit",) * 4 + ("validation",) * 2 + ("test",) * 2,
    "recording": ("fit",) * 6 + ("validation",) * 3 + ("test",) * 3,
}
RUN_S: dict[Level, float] = {"robot": 5.0, "recording": 60.0}
HEAD = ("study", "before, CPU s", "now, CPU s", "ratio", "wanted", "now, s", "two jobs, s", "wanted, CPU s")


def benchmark(
    levels: tuple[Level, ...] = ("bench", "robot"),
    before: str = BEFORE_STATIONS,
    seed: int = 0,
    out: Path | None = None,
) -> None:
    """Print what the studies cost now and before, and whether one and two jobs give the same gap.json.

    Example: python benchmarks/gap.py --levels bench

    Args:
        levels: studies to time.
        before: earlier version to compare with, a commit of this repository.
        seed: seed of the noise and of the studies.
        out: JSON file to write.
    """
    cores = len(os.sched_getaffinity(0))
    machine = f"{cores} cores, load {os.getloadavg()[0]:.1f} before; compared with {before[:7]}"
    print(machine)
    model = fitted_model(fit_dataset(read_dataset(ROOT / "examples" / "logs")))
    results = {}
    with tempfile.TemporaryDirectory() as folder, checked_out(before) as earlier:
        write_model(model, file := Path(folder) / "model.json")
        for level in levels:
            logs = ROOT / "examples" / "gap_logs" if level == "bench" else Path(folder) / level
            if level != "bench":
                write_dataset(robot_logs(model, level, seed), logs)
            results[level] = compared(level, {"logs": str(logs), "model": str(file), "seed": seed}, earlier)
            _print(level, results[level])
    print("\n" + markdown_table(HEAD, [_row(level, r) for level, r in results.items()]))
    if out is not None:
        write_json(
            out, {"format": "mecanum-benchmark-gap/2", "seed": seed, "machine": machine, "results": results}
        )


def compared(level: Level, request: dict[str, Any], earlier: Path) -> dict[str, Any]:
    """Return times and results of a study: in turn by the earlier version and this one, then by two jobs."""
    before, now = [], []
    for _ in range(ROUNDS[level]):
        before.append(study(earlier, {**request, "jobs": 1}))
        now.append(study(ROOT, {**request, "jobs": 1}))
    two = study(ROOT, {**request, "jobs": 2})
    before_s, now_s = (median(one["cpu_s"] for one in times) for times in (before, now))
    one = now[0]
    return {
        **{name: one[name] for name in ("runs", "log_s", "sets", "sentence")},
        "sentence_before": before[0]["sentence"],
        "before_cpu_s": before_s,
        "jobs_1_cpu_s": now_s,
        "ratio": before_s / now_s,
        "jobs_1_s": median(each["seconds"] for each in now),
        "jobs_2_s": two["seconds"],
        "equal": all(each["gap_json"] == two["gap_json"] for each in now),
    }


def study(checkout: Path, request: dict[str, Any]) -> dict[str, Any]:
    """Return what one study by the version in a folder costs and says (`benchmarks/gap_study.py`).

    Raises:
        MecanumError: that version cannot do the study.
    """
    packages = [sysconfig.get_path(name) for name in ("purelib", "platlib")]
    asked = {**request, "checkout": str(checkout), "packages": list(dict.fromkeys(packages))}
    with tempfile.TemporaryDirectory() as folder:
        write_json(file := Path(folder) / "request.json", asked)
        command = [sys.executable, "-S", str(Path(__file__).with_name("gap_study.py")), str(file)]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise MecanumError(f"the study by {checkout} failed: {done.stderr.strip()[-500:]}")
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


@contextmanager
def checked_out(commit: str) -> Iterator[Path]:
    """Check a commit out into a temporary folder, compile its plugin there, and remove it at the end.

    Raises:
        MecanumError: there is no such commit, or its plugin does not compile.
    """
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "earlier"
        _done(["git", "-C", str(ROOT), "worktree", "add", "--detach", str(place), commit])
        try:
            _compile(place / "mecanum_env" / "plugin")
            yield place
        finally:
            _done(["git", "-C", str(ROOT), "worktree", "remove", "--force", str(place)])


def _compile(plugin: Path) -> None:
    """Compile the plugin's sources in their folder, with the options of CMakeLists.txt."""
    import mujoco

    release, mujoco_folder = mujoco.mj_versionString(), Path(mujoco.__path__[0])
    library = next(mujoco_folder.glob("libmujoco.*"))
    options = ["-std=c11", "-O2", "-ffp-contract=off", "-fPIC", "-fvisibility=hidden", "-shared"]
    sources = [str(source) for source in sorted(plugin.glob("*.c"))]
    target = plugin / f"mecanum_wheel-mujoco-{release}.so"
    include = str(mujoco_folder / "include")
    _done(["cc", *options, "-I", include, *sources, str(library), "-lm", "-o", str(target)])


def _done(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise MecanumError(f"{' '.join(command[:5])} ... failed: {done.stderr.strip()}")


def robot_logs(model: Model, level: Level, seed: int) -> Dataset:
    """Return runs, without repeats, of the model's robot with the effects of `HIDDEN`."""
    rng = np.random.default_rng(seed)
    truth = model
    for name, values in HIDDEN.items():
        truth = truth.with_effect(name, **values)
    runs = []
    for number, split in enumerate(SPLITS[level]):
        plan = _run(f"drive_{number}.csv", split, RUN_S[level], rng)
        shown = predict(truth, plan, Start())
        logged = {
            name: shown[name] + sd * rng.standard_normal(shown[name].size) for name, sd in NOISE.items()
        }
        runs.append(replace(plan, channels=logged))
    return Dataset(f"{level}, {len(runs)} drives of {RUN_S[level]:g} s", tuple(runs), ())


def _run(file: str, split: Split, seconds: float, rng: np.random.Generator) -> Run:
    blocks = [_commands(rng) for _ in range(round(seconds / 5.0))]
    commands = np.concatenate(blocks)
    time_s = np.linspace(0.0, seconds, round(seconds / SAMPLE_S) + 1)
    rows = np.minimum(np.floor(time_s / COMMAND_S + 1e-6).astype(int), len(commands) - 1)
    empty = {name: np.zeros(time_s.size) for name in NOISE}
    return Run(file, file.removesuffix(".csv"), split, time_s, BodyCommand(*commands[rows].T), empty)


def _commands(rng: np.random.Generator) -> FloatArray:
    """Return 5 s of V [rpm], theta [deg] and VC [rpm], a row per 0.1 s: rest, then ten held 0.4 or 0.5 s."""
    v, theta, vc = rng.integers(10, 91, 10), 15 * rng.integers(-12, 13, 10), rng.integers(-30, 31, 10)
    rows = np.stack([v, theta, np.where(rng.random(10) < 0.5, 0, vc)], axis=1).astype(float)
    holds = rng.permutation(np.repeat([4, 5], 5))
    return np.concatenate([np.zeros((5, 3)), np.repeat(rows, holds, axis=0)])


def _print(level: Level, r: dict[str, Any]) -> None:
    print(f"\n{level}: {r['runs']} runs, {r['log_s']:.0f} s of log")
    print(f"  before: {r['sentence_before']}")
    print(f"  now:    {r['sentence']}")
    print(f"  sets fitted by simulation    {r['sets']:8d}")
    print(f"  gap.json of one and two jobs {'equal' if r['equal'] else 'DIFFERENT'}, bit for bit", flush=True)


def _row(level: Level, r: dict[str, Any]) -> tuple[str, ...]:
    times = (f"{r['before_cpu_s']:.1f}", f"{r['jobs_1_cpu_s']:.1f}", f"{r['ratio']:.1f}", WANTED_RATIO[level])
    return (level, *times, f"{r['jobs_1_s']:.1f}", f"{r['jobs_2_s']:.1f}", f"{WANTED_S[level]:.0f}")


if __name__ == "__main__":
    sys.exit(run(benchmark, prog="python benchmarks/gap.py"))
