"""How fast the online estimator learns, how fast it follows a changed law, and the time per sample.

Commands are whole numbers within +-135 rpm, held for 0.1 s; 120 samples per second, 0.5 rpm noise, 1 rpm
rounding. "Error" is the rms error of the free-running law on new data over the noise: 1 is perfect.

    python benchmarks/online.py --out out/benchmark_online.json
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any, Final

import numpy as np
from tqdm import tqdm

from mecanum_env.cli import run
from mecanum_env.files import write_json
from mecanum_env.law import LawState, WheelLaw
from mecanum_env.model import paper_model
from sysid.online import OnlineEstimator, OnlineOptions, first_order_law
from sysid.studies.synthetic import Samples, free_run_error_rpm, random_samples, random_stable_law

NOISE_RPM: Final = float(np.hypot(0.5, 1.0 / np.sqrt(12.0)))
"""Standard deviation of noise and rounding together [rpm]."""
AFTER_S: Final = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
"""Times at which the error is evaluated [s]."""


def benchmark(trials: int = 100, seed: int = 0, quick: bool = False, out: Path | None = None) -> None:
    """Print the results, and write them as JSON with --out.

    Example: python benchmarks/online.py --trials 100

    Args:
        trials: number of trials of learning and of changing laws.
        seed: seed of laws, commands and noise.
        quick: run 10 trials.
        out: JSON file to write.
    """
    trials = 10 if quick else trials
    law = paper_model().wheel.law
    results = {
        "learning": learning(law, trials, seed, change=False),
        "change": learning(law, trials, seed, change=True),
        "cost": cost(law, seed),
    }
    for name, title in (
        ("learning", "paper's law from a first-order start"),
        ("change", "paper's law changed to a random one"),
    ):
        item = results[name]
        print(
            f"{title}, {trials} trials; stable at {item['stable_share']:.0%} of samples; error / noise after"
        )
        for after, median, p90, worst, share in zip(
            AFTER_S, item["median"], item["p90"], item["max"], item["share_within_1_2"], strict=True
        ):
            print(
                f"  {after:3.1f} s: median {median:6.3f}  p90 {p90:6.3f}  max {worst:7.3f}  "
                f"<= 1.2: {share:.0%}"
            )
    item = results["cost"]
    print(
        f"cost of a sample: median {item['median_us']:.0f} us, p99 {item['p99_us']:.0f} us, "
        f"{item['ratio_to_tick']:.1f} times WheelLaw.tick"
    )
    if out is not None:
        write_json(out, {"format": "mecanum-benchmark-online/1", "seed": seed, "results": results})


def learning(law: WheelLaw, trials: int, seed: int, *, change: bool) -> dict[str, Any]:
    """Learn the law from a first-order lag; with `change`, a random one after 5 s of the law."""
    rows, stable = [], []
    ticks = round(AFTER_S[-1] / law.sample_period_s)
    for trial in tqdm(range(trials), desc="changes" if change else "learning", leave=False, disable=None):
        rng = np.random.default_rng([seed, 2 if change else 1, trial])
        new = random_stable_law(rng, law.sample_period_s) if change else law
        before = [(law, 600)] if change else []
        data = random_samples([*before, (new, ticks)], rng)
        estimator = OnlineEstimator(OnlineOptions(), first_order_law(law.sample_period_s))
        errors, stable_share = _follow(estimator, data, 600 if change else 0, new, rng)
        rows.append(errors)
        stable.append(stable_share)
    return _summary(rows, stable)


def cost(law: WheelLaw, seed: int) -> dict[str, float]:
    """Measure the time of `update`, and that of one tick of the law."""
    data = random_samples([(law, 6000)], np.random.default_rng([seed, 3]))
    estimator = OnlineEstimator(OnlineOptions(), first_order_law(law.sample_period_s))
    times = np.empty(len(data.speed_rpm))
    for k, (command, speed) in enumerate(zip(data.command_rpm, data.speed_rpm, strict=True)):
        begin = perf_counter()
        estimator.update(command, speed)
        times[k] = perf_counter() - begin
    state, ticks = LawState(), np.empty(len(times))
    for k, command in enumerate(data.command_rpm):
        begin = perf_counter()
        _, state = law.tick(state, command)
        ticks[k] = perf_counter() - begin
    return {
        "median_us": float(1e6 * np.median(times)),
        "p99_us": float(1e6 * np.quantile(times, 0.99)),
        "ratio_to_tick": float(np.median(times) / np.median(ticks)),
    }


def _follow(
    estimator: OnlineEstimator, data: Samples, begin: int, law: WheelLaw, rng: np.random.Generator
) -> tuple[list[float], float]:
    """Return error / noise at `AFTER_S` after tick `begin`, and the share of samples with a stable law."""
    held_out = random_samples([(law, 1200)], rng)
    found = [estimator.update(r, y).law for r, y in zip(data.command_rpm, data.speed_rpm, strict=True)]
    at = [begin + round(after / law.sample_period_s) - 1 for after in AFTER_S]
    errors = [free_run_error_rpm(found[k], held_out) / NOISE_RPM for k in at]
    return errors, float(np.mean([item.is_stable for item in found]))


def _summary(rows: Sequence[Sequence[float]], stable: Sequence[float]) -> dict[str, Any]:
    errors = np.array(rows)
    return {
        "after_s": list(AFTER_S),
        "median": np.median(errors, axis=0).tolist(),
        "p90": np.quantile(errors, 0.9, axis=0).tolist(),
        "max": np.max(errors, axis=0).tolist(),
        "share_within_1_2": np.mean(errors <= 1.2, axis=0).tolist(),
        "stable_share": float(np.mean(stable)),
    }


if __name__ == "__main__":
    sys.exit(run(benchmark, prog="python benchmarks/online.py"))
