"""Cases of hidden effects in robots: what a change does, how large it is, and that a seed repeats."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from mecanum_env.units import FloatArray
from sysid.logs import read_dataset
from sysid.studies.zoo.cases.robot.change import RobotChange, with_sensors
from sysid.studies.zoo.cases.robot.changes import (
    MAY_HAVE_TWINS,
    ROBOT_CHANGES,
    UNSEEN_WHEN_GENTLE,
    twins,
)
from sysid.studies.zoo.cases.robot.draw import draw_robot_case, fit_commands, study_commands
from sysid.studies.zoo.cases.robot.outsiders import ROBOT_OUTSIDERS, RobotOutsider
from sysid.studies.zoo.cases.robot.plans import GENTLE_PLAN, PLANS, sequences, usable_rpm
from sysid.studies.zoo.cases.robot.schedule import BLOCK, in_turn, kind_of
from sysid.studies.zoo.cases.robot.size import solve_size, yardstick
from sysid.studies.zoo.cases.write import write_robot_case
from sysid.studies.zoo.robots.draw import draw_robot
from sysid.studies.zoo.robots.robot import Robot
from sysid.studies.zoo.robots.simulate import simulate

ALL = (*ROBOT_CHANGES, *ROBOT_OUTSIDERS)
SINGLE_SEED, QUIET_SEED = 20, 13
"""Cases with few and short runs."""


@cache
def drawn(seed: int) -> Robot:
    return draw_robot(seed)


def title(change: RobotChange | RobotOutsider) -> str:
    return change.label if isinstance(change, RobotChange) else change.words


def able_seed(change: RobotChange | RobotOutsider) -> int:
    """Return the seed of the first drawn robot that can have the change."""
    return next(seed for seed in range(40) if change.possible(drawn(seed)))


def able(change: RobotChange | RobotOutsider) -> Robot:
    return drawn(able_seed(change))


def gross(change: RobotChange | RobotOutsider, robot: Robot) -> Robot:
    return change.apply(robot, 1.0, np.random.default_rng(5))


def logs_of(robot: Robot, rows: FloatArray) -> Mapping[str, FloatArray]:
    return simulate(robot, rows, np.random.default_rng(4)).channels


@cache
def unchanged(seed: int) -> tuple[FloatArray, Mapping[str, FloatArray]]:
    """Return commands for a drawn robot, and its logs."""
    rows = sequences(drawn(seed), "free_driving", 1, np.random.default_rng(3))[0]
    return rows, logs_of(drawn(seed), rows)


def largest_difference(seed: int, other: Robot) -> float:
    """Return how far the logs of two robots with the same luck are apart, over the channels' own size."""
    rows, before = unchanged(seed)
    logs = before, logs_of(other, rows)
    return max(
        float(np.nanmax(np.abs(logs[0][name] - logs[1][name])) / np.nanmax(np.abs(logs[0][name])))
        for name in logs[0]
    )


@pytest.mark.parametrize("change", ALL, ids=title)
def test_a_gross_change_shows_in_the_logs_of_a_drawn_robot(change):
    seed = able_seed(change)
    assert largest_difference(seed, gross(change, drawn(seed))) > 0.02


@pytest.mark.parametrize("change", ROBOT_CHANGES, ids=title)
def test_the_truth_of_a_change_is_finite(change):
    robot = able(change)
    hidden = change.hidden(robot, gross(change, robot), 1.0)
    assert (hidden.name, hidden.form) == (change.name, change.form)
    assert all(math.isfinite(value) for value in hidden.parameters.values())


@pytest.mark.parametrize("change", ALL, ids=title)
def test_a_change_of_size_0_is_none(change):
    robot = able(change)
    assert change.apply(robot, 0.0, np.random.default_rng(5)) == robot


def test_labels_name_one_change_each():
    labels = Counter(change.label for change in ROBOT_CHANGES)
    assert set(labels.values()) == {1}
    assert {*UNSEEN_WHEN_GENTLE, *MAY_HAVE_TWINS} <= labels.keys()


def test_the_truth_is_in_the_units_of_the_contract():
    by_label = {change.label: change for change in ROBOT_CHANGES}
    robot = drawn(2)
    track = by_label["track_width"]
    wide = gross(track, robot)
    scale = track.hidden(robot, wide, 1.0).parameters["scale"]
    arms = [r.body.half_wheelbase_m + r.body.half_track_m for r in (robot, wide)]
    assert arms[1] == pytest.approx(scale * arms[0])
    turned = by_label["mount_yaw"].hidden(robot, with_sensors(robot, turned_deg=5.0), 1.0)
    assert turned.parameters["angle_deg"] == pytest.approx(5.0 - robot.sensors.turned_deg)


@pytest.mark.parametrize("plan", PLANS)
def test_wheel_commands_stay_within_the_usable_speed(plan):
    robot = drawn(3)
    for rows in sequences(robot, plan, 6, np.random.default_rng(0)):
        v, theta, vc = rows[:, 0], np.radians(rows[:, 1]), rows[:, 2]
        fastest = np.abs(v * np.cos(theta)) + np.abs(v * np.sin(theta)) + np.abs(vc)
        assert 0.0 < fastest.max() <= usable_rpm(robot) * (1.0 + 1e-9)
        assert not rows[0].any()


def test_the_gentle_plan_only_goes_faster_straight_ahead():
    for rows in sequences(drawn(3), GENTLE_PLAN, 4, np.random.default_rng(0)):
        assert not rows[:, 1:].any()
        assert (np.diff(rows[:, 0]) >= 0.0).all()


def test_only_a_measured_path_tells_the_scale_of_velocity_from_geometry():
    by_label = {change.label: change for change in ROBOT_CHANGES}
    for label, names in (("track_width", ("sensor_scale",)), ("command_latency/fixed", ("sensor_latency",))):
        assert twins(by_label[label], with_sensors(drawn(3), pose=False)) == names
    assert twins(by_label["track_width"], with_sensors(drawn(3), pose=True)) == ()


def test_every_block_of_seeds_has_every_kind_in_its_share():
    counts = [Counter(kind_of(seed)[0] for seed in range(k * BLOCK, (k + 1) * BLOCK)) for k in range(4)]
    assert all(count == counts[0] for count in counts)
    assert counts[0]["quiet"] == BLOCK // 4
    assert counts[0]["single"] == round(0.45 * BLOCK)
    turns = [turn for kind, turn in map(kind_of, range(3 * BLOCK)) if kind == "single"]
    assert turns == list(range(len(turns)))


def test_things_come_round_in_turn():
    first = [in_turn(7, turn, 0)[0] for turn in range(14)]
    assert sorted(first[:7]) == sorted(first[7:]) == list(range(7))
    assert sorted(in_turn(7, 3, 0)) == list(range(7))


def test_a_signal_is_over_the_noise_of_repeats():
    robot = with_sensors(drawn(3), noise_m_s=1.0)
    measure = yardstick(robot, sequences(robot, "slow", 1, np.random.default_rng(0)), 0)
    assert measure.noise["vx_m_s"] == pytest.approx(1.0, rel=0.1)
    assert measure.signal(robot) == 0.0
    biased = with_sensors(robot, bias_vx_m_s=robot.sensors.bias_vx_m_s + 2.0)
    assert measure.signal(biased) == pytest.approx(2.0, rel=0.1)


def test_a_size_is_solved_for_its_signal():
    size, signal = solve_size(lambda size: 50.0 * size**3, 4.0)
    assert signal == pytest.approx(4.0, rel=0.1)
    assert signal == 50.0 * size**3
    assert solve_size(lambda size: size, 4.0) == (1.0, 1.0)


def test_a_drawn_single_has_the_signal_that_its_logs_show():
    case, robot, changed = draw_robot_case(SINGLE_SEED)
    assert case.kind == "single"
    assert 0.25 < case.signal < 33.0
    assert yardstick(robot, study_commands(case, robot), case.seed).signal(changed) == case.signal
    assert case.hidden[0].signal == case.signal


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("case")
    write_robot_case(QUIET_SEED, folder)
    return folder


def test_the_same_seed_writes_the_same_bytes(written, tmp_path):
    write_robot_case(QUIET_SEED, tmp_path)
    files = [
        {path.relative_to(f): path.read_bytes() for path in f.rglob("*") if path.is_file()}
        for f in (written, tmp_path)
    ]
    assert files[0] == files[1]
    assert Path("robot.json") in files[0]


def test_a_written_case_is_a_folder_of_logs_with_repeats_and_splits(written):
    nominal, logs = read_dataset(written / "nominal"), read_dataset(written / "logs")
    assert Counter(run.split for run in nominal.runs) == {"fit": 8, "validation": 2, "test": 2}
    groups = Counter(run.group for run in logs.runs)
    assert len(groups) == 2
    assert set(groups.values()) == {2}


def test_the_same_commands_are_those_of_the_fit():
    case, robot, changed = draw_robot_case(SINGLE_SEED, "same")
    commands, fitted = study_commands(case, robot), fit_commands(SINGLE_SEED, robot)
    np.testing.assert_array_equal(commands, fitted[: len(commands)])
    assert case.name.startswith(f"robot-{SINGLE_SEED:04d}-same-single-")
    assert yardstick(robot, commands, case.seed).signal(changed) == case.signal
