"""What it costs to hand a task to a worker: empty tasks and tasks of 10 ms, in this process, in two, on Ray.

A task of 10 ms waits instead of computing, so that other programs on the machine disturb the times little.
All executors stay open and take turns; the median over the rounds counts. Overhead per task is the time of a
round times the number of jobs over the number of tasks, less what the task itself takes.

    python benchmarks/executor.py --out out/bench/executor.json
"""

from __future__ import annotations

import importlib.util
import os
import statistics
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from mecanum_env.cli import run
from mecanum_env.errors import require_at_least
from mecanum_env.files import write_json
from mecanum_env.markdown import markdown_table
from mecanum_env.parallel import Executor, Task, Workers, executor

TASK_S = {"empty": 0.0, "10 ms": 0.01}
"""Kind of task -> how long it takes [s]."""
HEAD = (
    "executor",
    "start, s",
    "empty tasks/s",
    "overhead, ms",
    "10 ms tasks/s",
    "overhead, ms",
    "of one job",
)


def benchmark(
    tasks: int = 400, rounds: int = 5, jobs: int = 2, ray_address: str | None = None, out: Path | None = None
) -> None:
    """Print tasks per second and overhead per task of every executor.

    Args:
        tasks: number of tasks of each kind in a round.
        rounds: the median over them counts.
        jobs: tasks at a time, of local processes and of Ray.
        ray_address: Ray cluster to join; by default one is started on this machine.
        out: JSON file to write.
    """
    require_at_least(1, tasks=tasks, rounds=rounds, jobs=jobs)
    asked = {"local, 1 job": Workers(jobs=1), f"local, {jobs} jobs": Workers(jobs=jobs)}
    if importlib.util.find_spec("ray") is not None:
        asked[f"ray, {jobs} jobs"] = Workers("ray", jobs, ray_address)
    cores = len(os.sched_getaffinity(0))
    print(f"{cores} cores, load {os.getloadavg()[0]:.1f} before; {tasks} tasks, median of {rounds} rounds")
    results = measured(asked, tasks, rounds)
    one = results["local, 1 job"]["10 ms"]["tasks_per_s"]
    print("\n" + markdown_table(HEAD, [_row(name, result, one) for name, result in results.items()]))
    if out is not None:
        about = {"format": "mecanum-benchmark-executor/1", "tasks": tasks, "rounds": rounds, "cores": cores}
        write_json(out, {**about, "results": results})


def measured(asked: dict[str, Workers], tasks: int, rounds: int) -> dict[str, dict[str, Any]]:
    """Return, for each of the executors, the time to start [s] and what each kind of task costs.

    Args:
        asked: name -> workers.
        tasks: number of tasks in a round.
        rounds: number of rounds.
    """
    results: dict[str, dict[str, Any]] = {}
    with ExitStack() as stack:
        pools: dict[str, Executor] = {}
        for name, workers in asked.items():
            began = time.perf_counter()
            pools[name] = stack.enter_context(executor(workers))
            pools[name].run([Task("first", time.sleep, (0.2,))] * workers.jobs)
            results[name] = {"start_s": time.perf_counter() - began - 0.2}
        for kind, seconds in TASK_S.items():
            work = [Task(kind, time.sleep, (seconds,))] * tasks
            times: dict[str, list[float]] = {name: [] for name in pools}
            for _ in range(rounds):
                for name, pool in pools.items():
                    began = time.perf_counter()
                    pool.run(work)
                    times[name].append(time.perf_counter() - began)
            for name, values in times.items():
                wall_s = statistics.median(values)
                overhead_ms = 1e3 * (wall_s * asked[name].jobs / tasks - seconds)
                results[name][kind] = {"tasks_per_s": tasks / wall_s, "overhead_ms": overhead_ms}
    return results


def _row(name: str, result: dict[str, Any], one: float) -> tuple[str, ...]:
    empty, short = result["empty"], result["10 ms"]
    return (
        name,
        f"{result['start_s']:.1f}",
        f"{empty['tasks_per_s']:.0f}",
        f"{empty['overhead_ms']:.2f}",
        f"{short['tasks_per_s']:.0f}",
        f"{short['overhead_ms']:.2f}",
        f"{short['tasks_per_s'] / one:.2f}",
    )


if __name__ == "__main__":
    sys.exit(run(benchmark, prog="python benchmarks/executor.py"))
