"""What MuJoCo's servo adds to the law when a bench log is replayed on the free wheel.

The packaged model, on a step to 80 rpm and on every log of a folder. `difference` is MuJoCo minus the law's
own simulation: rounding, since the wheel's inertia is fed forward.

    python benchmarks/replay.py --logs examples/logs --out out/benchmark_replay.json
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
from mecanum_env.simulator import compile_bench
from mecanum_env.simulator.bench import law_of_bench, replay_bench
from mecanum_env.units import FloatArray
from sysid.logs import BenchCommand, read_dataset


def benchmark(logs: Path = Path("examples/logs"), model: Path | None = None, out: Path | None = None) -> None:
    """Print what the servo adds, in rpm; write JSON with --out.

    Example: python benchmarks/replay.py --logs examples/logs

    Args:
        logs: a folder of bench logs, whose commands are replayed.
        model: a model.json; the packaged model by default.
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
    added = wheel - law
    return {
        "name": name,
        "rms_rpm": float(np.sqrt(np.mean(added**2))),
        "max_rpm": float(np.max(np.abs(added))),
    }


def _print(results: list[dict[str, Any]]) -> None:
    print(f"{'run':<24}{'difference rms':>16}{'max':>12}   [rpm]")
    for r in results:
        print(f"{r['name']:<24}{r['rms_rpm']:16.2e}{r['max_rpm']:12.2e}")


def main() -> None:
    """Run from the command line."""
    sys.exit(run(benchmark))


if __name__ == "__main__":
    main()
