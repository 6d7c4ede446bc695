"""The search on robots with other speeds, clocks or ceilings than the packaged one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.friction import droop_rpm
from mecanum_env.effects.scale import REFERENCE, Scale
from mecanum_env.model import Model, paper_model
from mecanum_env.simulator import replay_bench
from mecanum_env.wheel_drive.drive import RING
from sysid.compare.least_squares import ResidualProblem, fit
from sysid.compare.measured import observe
from sysid.compare.model_error import Whitener
from sysid.compare.noise import measure_noise
from sysid.compare.search_space import Coordinate, coordinate, effect_set, scale_of, scanned
from sysid.gap.search.responses import Library, responses
from sysid.gap.search.sets import EMPTY, Search
from sysid.gap.search.thresholds import SearchEffort
from sysid.logs import BenchCommand, Dataset, Run, Split

from .conftest import MakeLogs

MODEL = paper_model()
EFFORT = SearchEffort(4, 4, 2, 4, 2)


def of_ceiling(rpm: float) -> Model:
    return replace(MODEL, wheel=replace(MODEL.wheel, saturation_rpm=rpm))


def fast_logs(model: Model, top_rpm: float) -> Dataset:
    """Return bench logs of a model at speeds up to `top_rpm`, with noise."""
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 4.0, 0.02)
    runs = []
    splits: tuple[Split, ...] = ("fit", "fit", "validation", "test")
    for i, split in enumerate(splits):
        levels = top_rpm * rng.uniform(-1.0, 1.0, 10)
        levels[:3] = top_rpm * np.array([1.0, -0.9, 0.8])
        command = np.rint(np.repeat(levels, time.size // 10))
        speed = replay_bench(model, time, command) + 0.5 * rng.standard_normal(time.size)
        runs.append(Run(f"{i}.csv", f"{i}", split, time, BenchCommand(command), {"speed_rpm": speed}))
    return Dataset("fast bench", tuple(runs), ())


def searched(logs: Dataset, model: Model, effects: list[str]) -> Search:
    runs = tuple(run for run in logs.runs if run.split != "test")
    observations = observe(replace(logs, runs=runs))
    problem = ResidualProblem(model, Whitener(observations, measure_noise(logs, observations), None))
    return Search(problem, Library(responses(problem, effects)), EFFORT)


def one_of(name: str, parameter: str, model: Model = MODEL, scale: Scale = REFERENCE) -> Coordinate:
    found = next(p for p in CATALOGUE[name].parameters if p.name == parameter)
    return coordinate(model, CATALOGUE[name], found, scale)


@pytest.mark.parametrize("ceiling", [100.0, 135.0, 180.0])
def test_drives_about_as_fast_as_the_reference_are_searched_as_the_catalogue_says(ceiling: float) -> None:
    scale = scale_of(of_ceiling(ceiling), ())
    for effect in CATALOGUE.values():
        for parameter in effect.parameters:
            assert parameter.relative or parameter.scaled(scale) is parameter


def test_the_logs_say_how_fast_a_drive_is_up_to_its_ceiling(bench_logs: MakeLogs) -> None:
    endless = of_ceiling(math.inf)
    assert scale_of(endless, bench_logs(MODEL).runs).top_rpm == pytest.approx(120.0, rel=0.02)
    fast = fast_logs(endless, 800.0).runs
    assert scale_of(endless, fast).top_rpm == pytest.approx(800.0, rel=0.02)
    assert scale_of(of_ceiling(30.0), fast).top_rpm == 30.0


@pytest.mark.parametrize(
    ("unit", "faster", "quicker"), [("rpm", 4.0, 1.0), ("rpm/s", 4.0, 8.0), ("rpm/s2", 4.0, 64.0)]
)
def test_ranges_follow_the_top_speed_and_the_rise_of_a_drive(
    unit: str, faster: float, quicker: float
) -> None:
    fast = Scale(top_rpm=4.0 * REFERENCE.top_rpm)
    quick = Scale(rise_s=REFERENCE.rise_s / 8.0)
    ranges = [p for effect in CATALOGUE.values() for p in effect.parameters if p.unit == unit]
    assert ranges
    for parameter in ranges:
        # How fast a host ramps its commands does not follow from how fast the drive is.
        rise = quicker if parameter.follows_rise else 1.0
        for scale, factor in ((fast, faster), (quick, rise)):
            scaled = parameter.scaled(scale)
            assert scaled.bounds == tuple(factor * end for end in parameter.bounds)
            assert scaled.scan == (parameter.scan and tuple(factor * v for v in parameter.scan))


def test_what_is_no_speed_is_searched_alike_on_every_drive() -> None:
    scale = Scale(6000.0, 0.013, 0.02)
    for effect in CATALOGUE.values():
        for parameter in effect.parameters:
            if parameter.unit not in ("rpm", "rpm/s", "rpm/s2") and not parameter.relative:
                assert parameter.scaled(scale) is parameter


@pytest.mark.parametrize("form", ["cold", "cold_friction"])
def test_what_fades_more_slowly_than_a_run_lasts_is_not_searched(form: str) -> None:
    """It would stand for what is there for good: a gain, or a friction."""
    fading = next(p for p in CATALOGUE[f"warm_up/{form}"].parameters if p.name == "time_constant_s")
    assert fading.scaled(Scale(run_s=7.0)).bounds == (pytest.approx(0.21), 7.0)


@pytest.mark.parametrize(("run_s", "most"), [(2.5, 0.32), (10.0, 0.08), (300.0, 0.08)])
def test_a_sag_may_be_faster_in_short_runs(run_s: float, most: float) -> None:
    sag = next(p for p in CATALOGUE["battery_sag"].parameters if p.name == "drop_per_s")
    assert sag.scaled(Scale(run_s=run_s)).bounds == (0.0, pytest.approx(most))


@pytest.mark.parametrize(("interval_s", "most"), [(0.005, 15.0), (0.025, 15.0), (0.1, 3.75)])
def test_a_swing_is_not_searched_where_samples_do_not_show_it(interval_s: float, most: float) -> None:
    swing = next(p for p in CATALOGUE["backlash/spring"].parameters if p.name == "swing_hz")
    searched = swing.scaled(Scale(interval_s=interval_s))
    assert searched.bounds[1] == pytest.approx(most)
    assert max(searched.scan or ()) < 0.5 / interval_s


def test_the_time_between_samples_is_that_of_the_slowest_run() -> None:
    logs = fast_logs(MODEL, 60.0)
    assert scale_of(MODEL, logs.runs).interval_s == max(run.median_interval_s for run in logs.runs)


def test_the_length_of_the_longest_run_is_known() -> None:
    logs = fast_logs(MODEL, 60.0)
    assert scale_of(MODEL, logs.runs).run_s == max(run.duration_s for run in logs.runs)


def test_a_ceiling_with_a_wide_knee_is_fitted_to_the_end() -> None:
    base = of_ceiling(math.inf)
    true = base.with_effect("speed_saturation", limit_rpm=150.0, softness_rpm=120.0)
    search = searched(fast_logs(true, 270.0), base, ["speed_saturation"])
    search.grow(1)
    best = search.best_fit
    again = fit(search.problem, best.candidate, best.place)
    assert again is not None
    assert again.cost > 0.99 * best.cost
    found = best.candidate.model(base, best.place).effects["speed_saturation"]
    assert found["softness_rpm"] == pytest.approx(120.0, rel=0.15)


@pytest.mark.parametrize("servo", [0.02, 5.0])
@pytest.mark.parametrize("top_rpm", [30.0, 135.0, 6000.0])
def test_a_friction_may_take_more_than_the_largest_speed(servo: float, top_rpm: float) -> None:
    model = replace(MODEL, robot=replace(MODEL.robot, servo_n_m_s_rad=servo))
    scale = Scale(top_rpm, servo_n_m_s_rad=servo)
    for name, parameter in (
        ("coulomb_friction", "torque_n_m"),
        ("stiction", "breakaway_n_m"),
        ("viscous_friction", "damping_n_m_s_rad"),
    ):
        most = one_of(name, parameter, model, scale).high
        assert droop_rpm(name, {parameter: most}, model, top_rpm) >= 1.2 * top_rpm * (1.0 - 1e-9)


def test_a_friction_of_a_robot_is_at_most_what_stops_its_drive() -> None:
    scale = Scale(servo_n_m_s_rad=5.0, torque_limit_n_m=1.5)
    assert one_of("coulomb_friction", "torque_n_m", MODEL, scale).high == pytest.approx(1.2 * 1.5)


def test_a_dead_band_and_a_ceiling_far_beyond_the_packaged_robots_are_found() -> None:
    base = of_ceiling(math.inf)
    true = base.with_effect("command_deadband", threshold_rpm=140.0)
    true = true.with_effect("speed_saturation", limit_rpm=600.0, softness_rpm=150.0)
    search = searched(fast_logs(true, 800.0), base, ["command_deadband", "speed_saturation", "speed_gain"])
    search.grow(1)
    search.grow(2)
    best = search.of_size(2)[0]
    found = best.candidate.model(base, best.place).effects
    assert best.names == ("command_deadband", "speed_saturation")
    assert found["command_deadband"]["threshold_rpm"] == pytest.approx(140.0, rel=0.1)
    assert found["speed_saturation"]["limit_rpm"] == pytest.approx(600.0, rel=0.02)
    assert found["speed_saturation"]["softness_rpm"] == pytest.approx(150.0, rel=0.2)


def test_softness_is_free_beside_a_limit_that_the_model_does_not_have() -> None:
    names = ["speed_saturation"]
    base = of_ceiling(math.inf)
    search = searched(fast_logs(base.with_effect("speed_saturation", limit_rpm=90.0), 120.0), base, names)
    growth = search.growths(search.base)[0]
    assert [c.parameter for c in growth.candidate.coordinates] == ["limit_rpm", "softness_rpm"]
    # Beside a limit that the model has, softness shows by itself, or is left alone.
    slow = searched(fast_logs(MODEL.with_effect("speed_saturation", limit_rpm=40.0), 60.0), MODEL, names)
    growth = slow.growths(slow.base)[0]
    assert [c.parameter for c in growth.candidate.coordinates] == ["limit_rpm"]


def test_a_command_is_delayed_no_longer_than_a_drive_remembers() -> None:
    assert one_of("command_latency", "delay_s").high == 0.5
    quick = replace(MODEL, wheel=replace(MODEL.wheel, command_period_s=MODEL.wheel.law.sample_period_s / 2))
    late = one_of("command_latency", "delay_s", quick)
    assert late.high < (RING - 3) * quick.wheel.command_period_s
    longest = effect_set(quick, ["command_latency"]).model(quick, np.ones(1))
    time = np.arange(0.0, 1.0, 0.01)
    assert np.all(np.isfinite(replay_bench(longest, time, np.full(time.size, 50.0))))
    delay = CATALOGUE["command_latency"].parameters[0]
    places = scanned(delay, late)
    assert len(set(places)) == len(places) > 1
    assert places[-1] == 1.0
    assert one_of("sensor_latency", "delay_s", quick).high == 0.5


def test_gain_and_scale_are_never_both_free_on_a_bench(bench_logs: MakeLogs) -> None:
    true = MODEL.with_effect("speed_gain", gain=0.9)
    search = searched(bench_logs(true), MODEL, ["speed_gain", "sensor_scale", "command_deadband"])
    search.grow(1)
    search.grow(2)
    search.swap(search.of_size(2)[0])
    sets = {fitted.names for fitted in search.fitted.values()}
    assert {EMPTY.names, ("speed_gain",), ("sensor_scale",), ("command_deadband", "sensor_scale")} <= sets
    assert not any({"speed_gain", "sensor_scale"} <= set(names) for names in sets)
