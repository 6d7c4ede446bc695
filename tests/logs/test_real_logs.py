"""Recordings of two real robots; skipped if they are not available."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from mecanum_env.errors import InputError
from sysid.logs import Dataset, read_dataset
from sysid.logs.noise import noise_from_repeats

RUNS = {
    "husky/left": 31,
    "husky/right": 31,
    "husky/body": 31,
    "micromouse/duty_left": 8,
    "micromouse/duty_right": 8,
    "micromouse/closed_loop_left": 6,
    "micromouse/closed_loop_right": 6,
}


def kinds(data: Dataset) -> Counter[str]:
    return Counter(finding.kind for finding in data.findings)


@pytest.mark.parametrize("name", RUNS)
def test_every_real_dataset_is_read(real_logs: Path, name: str) -> None:
    data = read_dataset(real_logs / name)
    assert len(data.runs) == RUNS[name]
    assert all(data.split(split) for split in ("fit", "validation", "test"))
    assert data.level == ("robot" if name == "husky/body" else "bench")
    assert noise_from_repeats(data.runs) is None
    # None has a wrong unit, a stated group that disagrees, or a file that is not listed.
    assert not {"units", "group", "unlisted", "split"} & set(kinds(data))


@pytest.mark.parametrize("name", ["husky", "micromouse"])
def test_a_robots_folder_names_its_datasets(real_logs: Path, name: str) -> None:
    inside = ", ".join(sorted(key.split("/")[1] for key in RUNS if key.startswith(name)))
    with pytest.raises(InputError, match=f"in its subfolders {inside}"):
        read_dataset(real_logs / name)


def test_the_husky_encoder_is_seen_to_hold_half_of_its_samples(real_logs: Path) -> None:
    shares = [f.value for f in read_dataset(real_logs / "husky/left").findings if f.kind == "held_samples"]
    assert len(shares) == 31
    assert np.median(shares) == pytest.approx(0.5, abs=0.03)


def test_the_husky_wheels_of_one_side_are_seen_to_be_one_sensor(real_logs: Path) -> None:
    assert kinds(read_dataset(real_logs / "husky/body"))["same_channel"] == 62


def test_the_micromouse_stamps_are_seen_to_be_uneven(real_logs: Path) -> None:
    found = {
        f.file: f.message
        for f in read_dataset(real_logs / "micromouse/duty_left").findings
        if f.kind == "uneven_stamps"
    }
    assert "intervals of 2 to 12 ms" in found["testPid6.csv.gz"]


def test_the_duty_is_scaled_to_rpm(real_logs: Path) -> None:
    data = read_dataset(real_logs / "micromouse/duty_left")
    calibration = next(run for run in data.runs if run.file == "wheelSpeedCalibration3.csv.gz")
    assert calibration.command.wheels_rpm.max() == pytest.approx(255 * 3.144)
