"""A law whose tick is shorter than the time between samples: what it does where no sample shows it."""

import numpy as np
import pytest

from sysid.fit import FitOptions
from sysid.fit.drive import LawFit, fit_law
from sysid.fit.drive.unseen_swings import SWINGS, swings_unseen, without_unseen_ticks
from sysid.logs import BenchCommand, Dataset, Run

ROW_S = 0.015
FINE = 60
"""Steps of the drive between two rows."""
SPLITS = ("fit", "fit", "fit", "fit", "validation", "test")


def sampled_run(number: int, split: str, rng: np.random.Generator) -> Run:
    """Return a run of a second-order drive that answers a row late; commands come with the rows."""
    rows = 170
    command = np.repeat(rng.integers(-130, 130, 12), rng.integers(25, 90, 12))[: rows - 17].astype(float)
    command = np.concatenate([np.zeros(17), command])[:rows]
    late = np.concatenate([np.zeros(FINE), np.repeat(command, FINE)])[: len(command) * FINE]
    step, speed, behind = ROW_S / FINE, np.zeros(late.size), 0.0
    for i in range(1, late.size):
        behind += step / 0.048 * (late[i - 1] - behind)
        speed[i] = speed[i - 1] + step / 0.144 * (behind - speed[i - 1])
    measured = speed[::FINE] + rng.normal(0.0, 0.3, len(command))
    time = np.arange(len(command)) * ROW_S
    name = f"run_{number}"
    return Run(f"{name}.csv", name, split, time, BenchCommand(command), {"speed_rpm": measured})


@pytest.fixture(scope="module")
def late_drive() -> Dataset:
    rng = np.random.default_rng(2)
    runs = tuple(sampled_run(number, split, rng) for number, split in enumerate(SPLITS))
    return Dataset("late drive", runs, ())


def fitted(dataset: Dataset, sample_period_s: float | None = None) -> LawFit:
    return fit_law(dataset, FitOptions(starts=2, sample_period_s=sample_period_s), lambda _: None)


@pytest.fixture(scope="module")
def swinging(late_drive: Dataset) -> LawFit:
    """Return a fit with a tick of half a row, as the user asked for."""
    return fitted(late_drive, ROW_S / 2)


def step_response(found: LawFit) -> np.ndarray:
    return found.law.simulate(np.full(200, 100.0))


def test_half_a_row_leaves_a_law_that_swings_where_no_sample_shows_it(swinging: LawFit) -> None:
    assert swinging.estimate.rms_rpm < 0.5
    assert np.ptp(step_response(swinging)) > 200.0
    assert swings_unseen(swinging)


def test_a_fit_chooses_a_tick_with_which_the_law_does_not_swing(late_drive: Dataset) -> None:
    found = fitted(late_drive)
    assert found.path.sample_period_s == pytest.approx(ROW_S)
    assert found.estimate.rms_rpm < 0.5
    assert not swings_unseen(found)
    response = step_response(found)
    assert np.min(response) > -1.0
    assert np.max(response) < 101.0
    assert any("would swing between samples" in note for note in found.notes)
    assert SWINGS not in found.notes


def test_a_tick_that_the_user_gave_stays_and_a_note_says_what_comes_of_it(swinging: LawFit) -> None:
    assert swinging.path.sample_period_s == ROW_S / 2
    assert SWINGS in swinging.notes


def test_less_than_two_ticks_between_samples_are_not_lengthened(late_drive: Dataset) -> None:
    assert without_unseen_ticks(fitted(late_drive, ROW_S)) is None
