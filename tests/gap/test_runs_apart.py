"""Runs that begin at different angles of the wheel are compared one by one, where that tells them apart."""

from __future__ import annotations

import numpy as np
import pytest

from mecanum_env.model import Model, paper_model
from mecanum_env.simulator import replay_bench
from sysid.compare.least_squares import at_likeliest_phase
from sysid.compare.predicted import SimulationSettings, predict
from sysid.gap.result import GapOptions
from sysid.gap.runs_apart import likely_wave, with_runs_apart
from sysid.gap.workflow import analyse
from sysid.logs import BenchCommand, Dataset, Run, Split

TIME_S = np.arange(400) / 100.0
NOISE_RPM = 0.4
SPLITS: tuple[Split, ...] = ("fit", "fit", "validation", "test")


def logs(model: Model, drift_rpm: float = 0.0, repeats: int = 3, seed: int = 0) -> Dataset:
    """Return sequences of commands, each driven so often from random angles of the wheel, with noise."""
    rng = np.random.default_rng(seed)
    runs = []
    for number, split in enumerate(SPLITS):
        command = np.repeat(np.concatenate([[0.0], np.rint(rng.uniform(-110.0, 110.0, 7))]), 50)
        for repeat in range(repeats):
            turned = {
                name: {**values, "phase_deg": rng.uniform(-180.0, 180.0)} if "per_turn" in values else values
                for name, values in model.effects.items()
            }
            start = Model(model.wheel, model.robot, turned)
            speed = replay_bench(start, TIME_S, command) + NOISE_RPM * rng.standard_normal(TIME_S.size)
            speed += drift_rpm * rng.standard_normal() * TIME_S / TIME_S[-1]
            name = f"run_{number}_{repeat}.csv"
            runs.append(Run(name, f"{number}", split, TIME_S, BenchCommand(command), {"speed_rpm": speed}))
    return Dataset("made", tuple(runs), ())


@pytest.fixture(scope="module")
def uneven() -> Model:
    """Return the packaged wheel with an encoder whose disk is off centre."""
    return paper_model().with_effect("encoder_eccentricity", share=0.04, per_turn=1.0)


@pytest.mark.parametrize("per_turn", [1.0, 7.0])
def test_the_wave_that_tells_repeats_apart_is_found(per_turn: float) -> None:
    model = paper_model().with_effect("encoder_eccentricity", share=0.05, per_turn=per_turn)
    found, share = likely_wave(logs(model).runs)
    assert found == per_turn
    assert share > 0.8


@pytest.mark.parametrize("drift_rpm", [0.0, 5.0])
def test_noise_and_drifts_leave_repeats_what_they_are(drift_rpm: float) -> None:
    made = logs(paper_model(), drift_rpm)
    assert likely_wave(made.runs)[1] < 0.6
    assert with_runs_apart(made) == (made, ())


def test_without_repeats_nothing_tells_them_apart(uneven: Model) -> None:
    made = logs(uneven, repeats=1)
    assert likely_wave(made.runs)[1] == 0.0
    assert with_runs_apart(made)[0] is made


def test_each_run_is_compared_by_itself_at_its_own_phase(uneven: Model) -> None:
    made = logs(uneven)
    apart, notes = with_runs_apart(made)
    assert len({run.group for run in apart.runs}) == len(made.runs)
    assert "1 period in each turn of the wheel" in notes[0]
    settings = SimulationSettings()
    for run in apart.runs:
        at = at_likeliest_phase(uneven, run, settings)
        left = run.channels["speed_rpm"] - predict(at, run, settings=settings)["speed_rpm"]
        assert float(np.std(left)) < 1.1 * NOISE_RPM
    assert at_likeliest_phase(paper_model(), made.runs[0], settings) == paper_model()


def test_an_uneven_encoder_is_named_from_runs_that_begin_at_any_angle(uneven: Model) -> None:
    fitted_on = logs(paper_model(), seed=1)
    report = analyse(logs(uneven), paper_model(), GapOptions(next_experiment=False, fitted_on=fitted_on))
    assert ("encoder_eccentricity",) in report.candidates
    assert report.gap.after < 1.2 * NOISE_RPM < report.gap.before
    assert any("each run is compared by itself" in note for note in report.notes)
