"""The fit as one function call: what it recovers and what it leaves alone."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.errors import InputError
from sysid.fit import Fit, FitOptions, fit_dataset, fit_json, fitted_model
from sysid.fit.estimators import METHODS
from sysid.logs import BenchCommand, Dataset, Finding, Run
from tests.fit.conftest import bench_run

QUICK = FitOptions(starts=2)
ALONE = replace(QUICK, effects="off")
"""Without a search for effects, which has no part in what is promised."""


def changed(data: Dataset, change: Callable[[Run], np.ndarray]) -> Dataset:
    return replace(data, runs=tuple(replace(r, channels={"speed_rpm": change(r)}) for r in data.runs))


@pytest.fixture(scope="module")
def plain(bench: Callable[..., Dataset]) -> Fit:
    """Return the fit of the bench's logs as they are."""
    return fit_dataset(bench(), QUICK)


def test_the_law_is_recovered_within_its_intervals(plain: Fit) -> None:
    fit = plain
    rise = fit.uncertainty["rise_time_s"]
    assert rise.low - 2e-3 < 0.124 < rise.high + 2e-3
    assert fit.estimate.delay_s == 0.0
    assert fit.path.saturation_rpm == 135.0
    assert fitted_model(fit).effects == {}


def test_a_delay_is_found_and_written_as_command_latency(bench: Callable[..., Dataset]) -> None:
    fit = fit_dataset(bench(delay_s=0.06), QUICK)
    assert fitted_model(fit).effects["command_latency"]["delay_s"] == pytest.approx(0.06, abs=4e-3)
    assert any("transport delay" in note for note in fit.notes)


def test_a_delay_that_is_given_is_kept(bench: Callable[..., Dataset]) -> None:
    fit = fit_dataset(bench(delay_s=0.06), replace(ALONE, delay_s=0.05))
    assert fit.estimate.delay_s == pytest.approx(0.05)


def test_a_ceiling_is_found_where_commands_go_beyond(bench: Callable[..., Dataset]) -> None:
    fit = fit_dataset(bench(largest_rpm=130.0, ceiling_rpm=70.0), ALONE)
    assert fitted_model(fit).wheel.saturation_rpm == pytest.approx(70.0, abs=1.0)
    assert any("ceiling of" in note for note in fit.notes)


@pytest.mark.parametrize("ceiling_rpm", [135.0, np.inf])
def test_the_assumed_ceiling_goes_where_held_out_speeds_contradict_it(ceiling_rpm: float) -> None:
    rng, runs = np.random.default_rng(0), []
    for number, split in enumerate(("fit", "fit", "validation", "test")):
        # Commands beyond the ceiling end before the wheel could stay there, and are only in held-out runs.
        largest = 100.0 if split == "fit" else 170.0
        levels = np.tile([0.0, largest, -0.5 * largest, 0.7 * largest], 4)
        name = f"run_{number}.csv"
        runs.append(bench_run(name, levels, rng=rng, split=split, hold_s=0.1, ceiling_rpm=ceiling_rpm))
    fit = fit_dataset(Dataset("fast", tuple(runs), ()), ALONE)
    assert fit.path.saturation_rpm == ceiling_rpm
    note = "clipped at the assumed 135 rpm" if np.isfinite(ceiling_rpm) else "the ceiling is not assumed"
    assert any(note in text for text in fit.notes)
    assert fit.methods["output-error"].errors["test"].rms_rpm < 0.6


def test_a_ceiling_that_is_given_is_kept(bench: Callable[..., Dataset]) -> None:
    data = bench(largest_rpm=130.0, ceiling_rpm=np.inf)
    fit = fit_dataset(data, replace(ALONE, saturation_rpm=100.0))
    assert fit.path.saturation_rpm == 100.0


def test_another_gain_is_pointed_out_and_fitted_on_request(bench: Callable[..., Dataset]) -> None:
    data = changed(bench(largest_rpm=100.0), lambda run: 1.2 * run.channels["speed_rpm"])
    assert any("--free-gain" in note for note in fit_dataset(data, QUICK).notes)
    free = fit_dataset(data, replace(ALONE, unit_gain=False))
    assert free.law.dc_gain == pytest.approx(1.2, abs=0.01)


def test_a_run_may_start_moving(bench: Callable[..., Dataset]) -> None:
    data = bench()
    late = [
        replace(
            run,
            time_s=run.time_s[96:] - run.time_s[96],
            command=BenchCommand(run.command.wheels_rpm[96:, 0]),
            channels={"speed_rpm": run.channels["speed_rpm"][96:]},
        )
        for run in data.runs
    ]
    fit = fit_dataset(replace(data, runs=tuple(late)), ALONE)
    assert any(run.initial_rpm != 0.0 for run in fit.runs["fit"]["wheel"])
    assert fit.estimate.rms_rpm < 2.0


def test_missing_samples_are_left_out(bench: Callable[..., Dataset]) -> None:
    def gaps(run: Run) -> np.ndarray:
        speed = run.channels["speed_rpm"].copy()
        speed[::3] = np.nan
        speed[40:80] = np.nan
        return speed

    assert fit_dataset(changed(bench(), gaps), ALONE).estimate.rms_rpm < 0.5


def test_held_samples_do_not_count_twice(bench: Callable[..., Dataset], plain: Fit) -> None:
    data = bench()
    said = tuple(Finding(run.file, "held_samples", 0.75, "speed_rpm") for run in data.runs)
    held = fit_dataset(replace(data, findings=said), ALONE).uncertainty
    assert held.effective_samples == pytest.approx(0.25 * plain.uncertainty.samples)
    assert held["A"].standard_error == pytest.approx(2.0 * plain.uncertainty["A"].standard_error, rel=0.02)


def test_uneven_stamps_and_twenty_samples_are_enough(bench: Callable[..., Dataset]) -> None:
    run = bench().runs[0]
    pick = np.sort(np.random.default_rng(0).choice(len(run.time_s) - 1, 20, replace=False))
    pick[0] = 0
    few = replace(
        run,
        time_s=run.time_s[pick],
        command=BenchCommand(run.command.wheels_rpm[pick, 0]),
        channels={"speed_rpm": run.channels["speed_rpm"][pick]},
    )
    fit = fit_dataset(Dataset("few", (few,), ()), ALONE)
    assert fit.law.is_stable
    assert fit.uncertainty.samples == 20


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda run: np.zeros(len(run.time_s)), "dead sensor"),
        (lambda run: np.full(len(run.time_s), np.nan), "no runs to fit"),
    ],
)
def test_data_that_say_nothing_are_refused(
    bench: Callable[..., Dataset], change: Callable[[Run], np.ndarray], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        fit_dataset(changed(bench(), change), QUICK)


def test_a_command_that_never_changes_is_refused(bench: Callable[..., Dataset]) -> None:
    data = bench(largest_rpm=0.2)
    with pytest.raises(InputError, match="never leaves the steady start"):
        fit_dataset(data, QUICK)


def test_a_dataset_without_runs_to_fit_is_refused(bench: Callable[..., Dataset]) -> None:
    data = bench()
    held_out = tuple(replace(run, split="test") for run in data.runs)
    with pytest.raises(InputError, match="no run has split"):
        fit_dataset(replace(data, runs=held_out), QUICK)


@pytest.mark.slow
def test_every_method_fits(bench: Callable[..., Dataset]) -> None:
    fit = fit_dataset(bench(), FitOptions(methods=tuple(METHODS), starts=1))
    assert set(fit_json(fit)["methods"]) == set(METHODS)
