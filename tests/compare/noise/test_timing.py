"""Noise of repeats whose changes of command act at other times each time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model
from sysid.compare.measured import observe
from sysid.compare.model_error import Whitener
from sysid.compare.noise import measure_noise
from sysid.compare.noise.timing import Response, TimingNoise, find_timing, slope_of
from tests.gap.conftest import MakeLogs

TIME_S = np.arange(0.0, 1.0, 0.02)
SPEED_RPM = 80.0 * (1.0 - np.exp(-TIME_S / 0.1))
SIGMA_RPM, DELAY_S = 0.5, 0.01


def responses(delay_s: float, seed: int, count: int = 60) -> list[Response]:
    """Return deviations of repeats that begin at other times, with white noise."""
    rng, slope = np.random.default_rng(seed), slope_of(SPEED_RPM, TIME_S)
    return [
        Response(-d * slope + SIGMA_RPM * rng.standard_normal(TIME_S.size), slope, 1.0)
        for d in delay_s * rng.standard_normal(count)
    ]


def overall(found: list[Response]) -> float:
    return float(np.sqrt(np.mean([one.deviation**2 for one in found])))


def test_delays_that_differ_are_found_with_the_noise_beside_them() -> None:
    found = responses(DELAY_S, seed=1)
    sigma = overall(found)
    timing = find_timing(found, sigma)
    assert timing is not None
    assert timing.delay_s == pytest.approx(DELAY_S, rel=0.25)
    assert timing.settled * sigma == pytest.approx(SIGMA_RPM, rel=0.1)


def test_white_noise_has_no_delays() -> None:
    found = responses(0.0, seed=2)
    assert find_timing(found, overall(found)) is None


def test_a_whitened_delay_is_one_number_of_each_hold(bench_logs: MakeLogs, base: Model) -> None:
    """However many samples a response has, a delay of one standard deviation counts as one."""
    logs = bench_logs(base)
    observations = observe(logs)
    even = replace(measure_noise(logs, observations), uneven={}, correlated={}, rounding={})
    size = even.sigma["speed_rpm"]
    late = replace(even, timing={"speed_rpm": TimingNoise(1.0, 0.05)})
    plain, knowing = (Whitener(observations, noise, None) for noise in (even, late))
    parts = [
        0.05 * slope_of(block.value, block.time_s) / np.sqrt(block.independent_repeats)
        for block in observations.blocks
    ]
    holds = sum(
        len(observations.situations[block.situation].runs[0].command_changes()[0])
        for block in observations.blocks
    )
    assert size > 0.0
    assert float(np.sum(plain.whiten(parts) ** 2)) > 10.0 * holds
    assert float(np.sum(knowing.whiten(parts) ** 2)) <= 1.05 * holds
