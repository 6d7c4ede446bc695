"""A study of robot logs without slip: the planar plant, which is much faster."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.model import Model, paper_model
from mecanum_env.simulator import BodyCommands, drive
from sysid.compare.measured import observe
from sysid.compare.predicted import SimulationSettings, predict
from sysid.gap.result import GapOptions
from sysid.gap.search.known_effects import known_effects
from sysid.gap.workflow import analyse
from sysid.logs import BodyCommand, Dataset, Finding, Run, Split

from .conftest import MakeLogs

MODEL = paper_model()
SPLITS: tuple[Split, ...] = ("fit", "validation", "test")


def robot_logs(model: Model) -> Dataset:
    """Return what a model does on the planar plant, its wheel speeds and yaw rate with noise."""
    rng = np.random.default_rng(2)
    time = np.arange(0.0, 2.5, 0.025)
    runs = []
    for i, split in enumerate(SPLITS):
        hold = np.minimum((time / 0.5).astype(int), 4)
        v, theta, vc = (rng.uniform(-100, 100, 5).round(), rng.integers(0, 360, 5), rng.uniform(-40, 40, 5))
        v[0] = vc[0] = 0.0
        rows = (v[hold], theta[hold].astype(float), vc.round()[hold])
        path = drive(model, BodyCommands(time, *rows), 2.5, plant="planar").channels_at(time)
        names = ("speed_fl_rpm", "speed_fr_rpm", "speed_rl_rpm", "speed_rr_rpm", "yaw_rate_rad_s")
        noise = {name: 0.01 if name == "yaw_rate_rad_s" else 0.5 for name in names}
        channels = {name: path[name] + noise[name] * rng.standard_normal(time.size) for name in names}
        runs.append(Run(f"{i}.csv", f"{i}", split, time, BodyCommand(*rows), channels))
    return Dataset("planar robot", tuple(runs), (), "planar")


def test_without_slip_what_slips_is_not_looked_for() -> None:
    gone = set(known_effects("robot")) - set(known_effects("robot", "planar"))
    assert gone == {"low_grip"}
    assert known_effects("bench", "planar") == known_effects("bench")


def test_two_wheels_on_one_sensor_are_both_compared() -> None:
    logs = robot_logs(MODEL)
    left = [
        replace(r, channels={**r.channels, "speed_rl_rpm": r.channels["speed_fl_rpm"]}) for r in logs.runs
    ]
    other = {"other": "speed_fl_rpm"}
    findings = [Finding(r.file, "same_channel", 1.0, "speed_rl_rpm", details=other) for r in left]
    seen = observe(replace(logs, runs=tuple(left), findings=tuple(findings)))
    # Else an effect of the wheel that is left out could do anything there.
    assert {"speed_fl_rpm", "speed_rl_rpm"} <= set(seen.channels)


def test_both_plants_predict_about_the_same() -> None:
    run = robot_logs(MODEL).runs[0]
    rollers, planar = predict(MODEL, run), predict(MODEL, run, settings=SimulationSettings(plant="planar"))
    for name in ("speed_fl_rpm", "speed_rr_rpm"):
        assert np.sqrt(np.mean((rollers[name] - planar[name]) ** 2)) < 3.0
        assert not np.array_equal(rollers[name], planar[name])


def test_limits_of_the_body_are_told_from_those_of_the_wheels() -> None:
    true = MODEL.with_effect("body_speed_limit", v_rpm=60.0, vc_rpm=25.0)
    only = ("body_speed_limit", "speed_saturation")
    options = GapOptions(only=only, max_effects=1, plant="planar", next_experiment=False)
    report = analyse(robot_logs(true), MODEL, options)
    assert [found.name for found in report.effects] == ["body_speed_limit"]
    found = report.effects[0].parameters
    assert found["v_rpm"].value == pytest.approx(60.0, abs=1.5)
    assert found["vc_rpm"].value == pytest.approx(25.0, abs=1.5)
    assert report.gap.before > 4.0 * report.gap.after
    # Without repeats there is no floor, and sigma is that of the noise all the same.
    assert report.gap.noise_floor is None
    assert report.gap.after == pytest.approx(1.0, abs=0.3)
    assert any("simulated without slip" in note for note in report.notes)


def test_bench_logs_have_no_plant(bench_logs: MakeLogs) -> None:
    with pytest.raises(InputError, match="plant planar: these are bench logs"):
        analyse(bench_logs(MODEL), MODEL, GapOptions(plant="planar"))
