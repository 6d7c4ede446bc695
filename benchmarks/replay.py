"""How far MuJoCo's free wheel is from the wheel law when a bench log is replayed on it.

The model is driven by a step to 80 rpm and by every log of a folder. The difference, MuJoCo minus the law's
own simulation, is rounding, since the wheel's inertia is fed forward.

    python benchmarks/replay.py --logs examples/logs --out out/bench/replay.json
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from mecanum_env.cli import run
from mecanum_env.files import write_json
from mecanum_env.model import Model, paper_model, read_model
from mecanum_env.simulator import compile_bench, replay_bench
from mecanum_env.simulator.bench import law_of_bench
from mecanum_env.statistics import rms
from mecanum_env.units import FloatArray
from sysid.logs import BenchCommand, read_dataset


def benchmark(logs: Path = Path("examples/logs"), model: Path | None = None, out: Path | None = None) -> None:
    """Print the difference [rpm] in each run; write JSON with --out.

    Example: python benchmarks/replay.py --logs examples/logs

    Args:
        logs: folder of bench logs, whose commands are replayed.
        model: model file; the packaged model by default.
        out: JSON file to write.
    """
    chosen = paper_model() if model is None else read_model(model)
    step_time = np.arange(0.0, 2.0, 0.01)
    results = [_compare(chosen, "step to 80 rpm", step_time, np.full(step_time.shape, 80.0))]
    for log in tqdm(read_dataset(logs).runs, desc="replaying", leave=False, disable=None):
        if isinstance(log.command, BenchCommand):
            results.append(_compare(chosen, log.file, log.time_s, log.command.command_rpm))
    _print(results)
    if out is not None:
        write_json(out, {"format": "mecanum-benchmark-replay/1", "results": results})


def _compare(model: Model, name: str, time_s: FloatArray, command_rpm: FloatArray) -> dict[str, Any]:
    mj_model = compile_bench(model)
    step = mj_model.opt.timestep
    clock = np.arange(int(np.ceil((time_s[-1] - time_s[0]) / step - 1e-9)) + 1) * step
    law = law_of_bench(model, time_s, command_rpm, clock)
    wheel = replay_bench(model, time_s, command_rpm, sample_times_s=time_s[0] + clock, mj_model=mj_model)
    difference = wheel - law
    return {"name": name, "rms_rpm": rms(difference), "max_rpm": float(np.max(np.abs(difference)))}


def _print(results: list[dict[str, Any]]) -> None:
    print(f"{'run':<24}{'difference rms':>16}{'max':>12}   [rpm]")
    for r in results:
        print(f"{r['name']:<24}{r['rms_rpm']:16.2e}{r['max_rpm']:12.2e}")


if __name__ == "__main__":
    sys.exit(run(benchmark))
