"""Accuracy, reliability and speed of the output-error method on synthetic logs with a known truth.

The logs are of the paper's law: steps of 10, 40, 80 and 130 rpm with 3 repeats, 2 s at 120 Hz, rounded to 1
rpm, with noise of 0.5 or 2 rpm. A start succeeds if it ends within 5 % of the best rms of all starts, all
random.

    python benchmarks/fit.py --starts 100 --out out/benchmark_fit.json
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from mecanum_env.cli import run
from mecanum_env.files import write_json
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.model import paper_model
from sysid.fit.estimators import Estimate, Options, estimate
from sysid.fit.statistics import residual_tests, uncertainty
from sysid.studies.synthetic import step_runs

NOISES_RPM = (0.5, 2.0)


def benchmark(
    starts: int = 100, realisations: int = 200, seed: int = 0, quick: bool = False, out: Path | None = None
) -> None:
    """Print the table of results; write it as JSON with --out.

    Example: python benchmarks/fit.py --starts 100 --realisations 200

    Args:
        starts: number of random starting points on one set of logs.
        realisations: number of noise realisations for errors and bias.
        seed: seed of the noise and the starts.
        quick: use 20 starts and 20 realisations.
        out: JSON file to write.
    """
    if quick:
        starts, realisations = 20, 20
    results = {}
    for noise in NOISES_RPM:
        results[f"noise_{noise:g}_rpm"] = result = {
            "noise_rpm": noise,
            "starts": random_starts(noise, starts, seed),
            "realisations": many_realisations(noise, realisations, seed),
        }
        _print(result)
    if out is not None:
        write_json(out, {"format": "mecanum-benchmark-fit/1", "seed": seed, "results": results})


def random_starts(noise_rpm: float, starts: int, seed: int) -> dict[str, Any]:
    """Fit one set of logs from many random starts: success, stability, time of one start."""
    runs = step_runs(paper_model().wheel.law, np.random.default_rng(seed), noise_rpm=noise_rpm)
    fitted = estimate(runs, options=Options(starts=starts, first_starts="random", seed=seed))
    milliseconds = 1e3 * np.array([start.seconds for start in fitted.starts])
    return {
        "count": starts,
        "success_share": fitted.success_share,
        "stable_share": fitted.stable_share,
        "median_ms": float(np.median(milliseconds)),
        "p95_ms": float(np.quantile(milliseconds, 0.95)),
        "max_ms": float(np.max(milliseconds)),
        "best_rms_rpm": fitted.rms_rpm,
    }


def many_realisations(noise_rpm: float, realisations: int, seed: int) -> dict[str, Any]:
    """Fit many noise realisations: error over the Cramer-Rao bound at the truth, bias, residual tests."""
    law = paper_model().wheel.law
    rng = np.random.default_rng(seed + 1)
    found: list[Estimate] = []
    covered, white, uncorrelated = [], [], []
    for _ in tqdm(range(realisations), desc=f"{noise_rpm:g} rpm noise", leave=False, disable=None):
        runs = step_runs(law, rng, noise_rpm=noise_rpm)
        fitted = estimate(runs, options=Options(starts=1))
        found.append(fitted)
        sure = uncertainty(runs, fitted)
        covered.append([sure[n].low <= getattr(law, n) <= sure[n].high for n in COEFFICIENTS])
        tests = residual_tests(runs, fitted, level=0.05)
        white.append(tests.whiteness.passed)
        uncorrelated.append(tests.input_correlation.passed)
    error = np.array([fitted.coefficients for fitted in found]) - law.coefficients
    at_truth = uncertainty(runs, replace(found[-1], law=law))
    bound = np.array([at_truth[name].cramer_rao for name in COEFFICIENTS])
    expected = np.array([at_truth[name].bias for name in COEFFICIENTS])
    mean_error = error.std(axis=0, ddof=1) / np.sqrt(realisations)
    return {
        "count": realisations,
        "coefficients": list(COEFFICIENTS),
        "cramer_rao": bound.tolist(),
        "rms_error_over_cramer_rao": (np.sqrt(np.mean(error**2, axis=0)) / bound).tolist(),
        "bias_over_its_standard_error": (error.mean(axis=0) / mean_error).tolist(),
        "bias_less_second_order_over_its_standard_error": (
            (error.mean(axis=0) - expected) / mean_error
        ).tolist(),
        "second_order_bias_over_cramer_rao": (expected / bound).tolist(),
        "coverage_of_95_percent_intervals": np.mean(covered, axis=0).tolist(),
        "whiteness_passed_at_5_percent": float(np.mean(white)),
        "input_correlation_passed_at_5_percent": float(np.mean(uncorrelated)),
    }


def _print(result: dict[str, Any]) -> None:
    starts, many = result["starts"], result["realisations"]
    print(f"\nnoise {result['noise_rpm']:g} rpm, rounding 1 rpm")
    print(
        f"  {starts['count']} random starts: {starts['success_share']:.1%} within 5 % of the best rms "
        f"({starts['best_rms_rpm']:.4f} rpm), {starts['stable_share']:.1%} stable; one start "
        f"{starts['median_ms']:.1f} ms median, {starts['p95_ms']:.1f} ms p95, {starts['max_ms']:.1f} ms max"
    )
    print(f"  {many['count']} realisations" + "".join(f"{name:>9}" for name in many["coefficients"]))
    for label, key in (
        ("Cramer-Rao bound", "cramer_rao"),
        ("rms error / bound", "rms_error_over_cramer_rao"),
        ("bias / its std. error", "bias_over_its_standard_error"),
        ("same, less Box's bias", "bias_less_second_order_over_its_standard_error"),
        ("Box's bias / bound", "second_order_bias_over_cramer_rao"),
        ("coverage of 95 %", "coverage_of_95_percent_intervals"),
    ):
        print(f"    {label:<22}" + "".join(f"{value:9.4f}" for value in many[key]))
    print(
        f"    right law passes at 5 %: whiteness {many['whiteness_passed_at_5_percent']:.1%}, "
        f"input correlation {many['input_correlation_passed_at_5_percent']:.1%}"
    )


if __name__ == "__main__":
    sys.exit(run(benchmark))
