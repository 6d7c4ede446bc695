"""A robot whose drives integrate and are limited is found where no law behind a servo is enough."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model, paper_model
from mecanum_env.units import RAD_S_PER_RPM
from sysid.fit import FitOptions, fit_dataset, fitted_model, pipeline
from sysid.fit.effects import EffectSearch, Reached
from sysid.fit.report import output as report
from sysid.fit.robot import effects as robot_effects
from sysid.fit.robot import find_robot_effects
from sysid.fit.robot import parameters as robot_parameters
from sysid.fit.robot import simple_robot as module
from sysid.fit.robot.effects import RobotWithEffects
from sysid.fit.robot.output_error import PlantData
from sysid.fit.robot.simple_robot import ROBOT_NUMBERS, simple_robots
from sysid.logs import BodyCommand, Dataset, Run

NOISE_RPM = 0.3


def wheels_of(data: Dataset) -> PlantData:
    names = tuple(name for name in data.runs[0].channels if name.startswith("speed_"))
    return PlantData(data.split("fit"), names, dict.fromkeys(names, NOISE_RPM))


@pytest.fixture(scope="module")
def limited() -> Model:
    """Return a robot whose loops integrate, whose torque is limited, and whose link is late."""
    model = paper_model()
    robot = replace(
        model.robot,
        servo_n_m_s_rad=0.3,
        servo_integral_n_m_rad=0.8,
        torque_limit_n_m=0.5,
        yaw_inertia_kg_m2=0.9,
    )
    return replace(model, robot=robot).with_effect("command_latency", delay_s=0.06)


@pytest.fixture(scope="module")
def logs(limited: Model, robot_logs: Callable[..., Dataset]) -> Dataset:
    return robot_logs(limited, runs=4, seconds=2.5)


@pytest.fixture(scope="module")
def start(logs: Dataset) -> Model:
    with pytest.MonkeyPatch.context() as only:
        # The logs have none, and what is tried besides takes most of the time.
        only.setattr(module, "_RAMPS", {"no ramps": ()})
        only.setattr(module, "WINDUPS", (0.0,))
        (found,) = simple_robots(paper_model(), ("friction",), wheels_of(logs))
        return found


def test_torque_limit_and_delay_are_found_without_a_place_to_start(limited: Model, start: Model) -> None:
    assert start.robot.torque_limit_n_m == pytest.approx(limited.robot.torque_limit_n_m, rel=0.1)
    # The packaged law's own rise is partly a delay to a lag of first order.
    assert start.effects["command_latency"]["delay_s"] == pytest.approx(0.06, abs=0.03)


def test_the_simple_robot_predicts_far_better_than_the_packaged_one(logs: Dataset, start: Model) -> None:
    data = wheels_of(logs)
    assert data.residual_rms(start) < 0.2 * data.residual_rms(paper_model())


@pytest.mark.parametrize("windup", [0.0, 1.0])
def test_an_integral_that_winds_up_is_found_and_one_that_does_not(
    limited: Model, robot_logs: Callable[..., Dataset], monkeypatch: pytest.MonkeyPatch, windup: float
) -> None:
    monkeypatch.setattr(module, "_RAMPS", {"no ramps": ()})
    robot = replace(limited.robot, torque_limit_n_m=0.3, servo_windup=windup)
    data = wheels_of(robot_logs(replace(limited, robot=robot), runs=4, seconds=2.5))
    found = simple_robots(paper_model(), ("friction",), data)
    assert [one.robot.servo_windup for one in found] == [0.0, 1.0]
    assert min(found, key=data.residual_rms).robot.servo_windup == windup


def test_repeats_are_left_out_and_equal_levels_held_otherwise_are_not(logs: Dataset) -> None:
    one = logs.split("fit")[0]
    stretched = replace(one, group="slower", time_s=1.5 * one.time_s)
    chosen = module._of_different_commands((one, replace(one, file="again.csv"), stretched))
    assert [run.group for run in chosen] == [one.group, "slower"]


def test_the_rates_of_ramps_need_no_wheel_that_a_run_does_not_show(logs: Dataset) -> None:
    data = wheels_of(logs)
    dark, lost, short = data.runs[0], data.runs[1], first_rows(data.runs[0], 3)
    dark = replace(dark, channels={**dark.channels, "speed_fl_rpm": np.full(dark.time_s.size, np.nan)})
    lost = replace(lost, channels={n: v for n, v in lost.channels.items() if n != "speed_rr_rpm"})
    whole = module._rates_rpm_s(data)
    assert module._rates_rpm_s(replace(data, runs=(*data.runs, dark, lost, short))) == whole
    assert set(module._rates_rpm_s(replace(data, runs=(dark, lost, short))).values()) == {0.0}


@pytest.mark.parametrize("seen", [0.0, 100.0])
def test_limits_are_tried_around_the_rates_that_were_seen_or_anywhere(seen: float) -> None:
    rates = dict.fromkeys(("v_ramp_rpm_s", "vc_ramp_rpm_s", "ramp_rpm_s"), seen)
    names = list(module._NUMBERS)
    places = dict(zip(names, module._places(("ramp_rpm_s",), rates).T, strict=True))
    assert set(places["v_ramp_rpm_s"]) == {1.0}
    for name, unit in (("acceleration_rad_s2", RAD_S_PER_RPM), ("ramp_rpm_s", 1.0)):
        tried = [module._NUMBERS[name].at(share) for share in places[name]]
        assert max(tried) / min(tried) > (100.0 if seen == 0.0 else 2.0)
        assert seen == 0.0 or 0.7 * seen * unit < min(tried) < max(tried) < 4.01 * seen * unit


def first_rows(run: Run, rows: int) -> Run:
    command = BodyCommand(*(values[:rows] for values in run.command.columns().values()))
    channels = {name: values[:rows] for name, values in run.channels.items()}
    return replace(run, time_s=run.time_s[:rows], command=command, channels=channels)


def test_what_was_measured_stays(logs: Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_TRIED", 4)
    monkeypatch.setattr(module, "_DESCENDED", 1)
    data, given = replace(wheels_of(logs), runs=logs.split("fit")[:1]), (*ROBOT_NUMBERS[:2], "servo_windup")
    known = replace(paper_model(), robot=replace(paper_model().robot, servo_windup=0.5))
    (found,) = simple_robots(known, given, data)
    for name in (*ROBOT_NUMBERS, "servo_windup"):
        assert (getattr(found.robot, name) == getattr(known.robot, name)) == (name in given), name


def test_ramps_and_the_friction_of_rollers_are_found(
    robot_logs: Callable[..., Dataset], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "WINDUPS", (0.0,))
    model = paper_model()
    weak = replace(model, robot=replace(model.robot, servo_n_m_s_rad=0.5, torque_limit_n_m=1.0))
    weak = weak.with_effect("body_acceleration_limit", v_rpm_s=200.0, vc_rpm_s=120.0)
    weak = weak.with_effect("roller_friction", torque_n_m=0.04)
    logs = robot_logs(weak, runs=4, seconds=2.5)
    (start,) = simple_robots(model, ("friction",), wheels_of(logs))
    found = start.effects
    assert found["body_acceleration_limit"] == pytest.approx({"v_rpm_s": 200.0, "vc_rpm_s": 120.0}, rel=0.1)
    assert found["roller_friction"]["torque_n_m"] == pytest.approx(0.04, rel=0.3)


def test_a_ramp_of_each_drive_with_slow_brakes_is_found(
    robot_logs: Callable[..., Dataset], monkeypatch: pytest.MonkeyPatch
) -> None:
    tried = "ramps of the drives"
    monkeypatch.setattr(module, "_RAMPS", {tried: module._RAMPS[tried]})
    monkeypatch.setattr(module, "WINDUPS", (0.0,))
    weak = paper_model().with_effect("acceleration_limit", limit_rpm_s=200.0, brake_rpm_s=100.0)
    logs = robot_logs(weak, runs=4, seconds=2.5)
    (found,) = simple_robots(paper_model(), ("friction",), wheels_of(logs))
    ramp = found.effects["acceleration_limit"]
    assert ramp == pytest.approx({"limit_rpm_s": 200.0, "brake_rpm_s": 100.0}, rel=0.3)


def test_a_ramp_with_round_ends_is_found_and_no_ramp_of_the_platform(
    robot_logs: Callable[..., Dataset], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ramps of both kinds with corners imitate it in these logs, and go elsewhere in others."""
    monkeypatch.setattr(module, "WINDUPS", (0.0,))
    true = {"limit_rpm_s": 180.0, "brake_rpm_s": 300.0, "jerk_rpm_s2": 1000.0}
    profile = replace(paper_model(), effects={"acceleration_limit/s_curve": true})
    logs = robot_logs(profile, runs=4, seconds=2.5)
    (found,) = simple_robots(paper_model(), ("friction",), wheels_of(logs))
    assert found.effects["acceleration_limit/s_curve"] == pytest.approx(true, rel=0.3)
    assert "body_acceleration_limit" not in found.effects


@pytest.fixture(scope="module")
def found(logs: Dataset, start: Model) -> RobotWithEffects | None:
    def known_start(alone: Model, given: tuple[str, ...], data: PlantData, *_: object) -> list[Model]:
        assert (alone, given, data.runs) == (paper_model(), (), logs.split("fit"))
        return [replace(start, robot=replace(start.robot, servo_windup=1.0)), start]

    with pytest.MonkeyPatch.context() as only:
        only.setattr(robot_effects, "simple_robots", known_start)
        # Nothing is missing but what the simple robot has, and growing takes most of the time.
        only.setattr(robot_effects, "_ROUNDS", 0)
        return find_robot_effects(logs, paper_model(), (), wheels_of(logs))


def test_law_effects_and_robot_together_reach_the_noise(found: RobotWithEffects | None) -> None:
    assert found is not None
    assert found.before > 10.0
    assert found.after == pytest.approx(1.0, abs=0.2)


def test_the_law_of_full_order_tells_which_integral_it_is(found: RobotWithEffects | None) -> None:
    """The start whose integral winds up comes first, and is wrong."""
    assert found is not None
    assert found.drive.model.robot.servo_windup == 0.0
    assert "winds up" not in found.note


def test_the_robots_parameters_are_found_with_their_errors(
    limited: Model, found: RobotWithEffects | None
) -> None:
    assert found is not None
    for one in found.parameters:
        true = getattr(limited.robot, one.name)
        assert abs(math.log(one.value / true)) < max(0.1, 4.0 * one.standard_error / one.value), one.name


def test_all_that_was_found_of_the_robot_is_in_the_model(
    logs: Dataset, start: Model, found: RobotWithEffects | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A limit that the logs never reach has no known error, and limits nothing else instead."""
    assert found is not None
    robot = replace(start.robot, servo_windup=1.0)
    monkeypatch.setattr(robot_effects, "simple_robots", lambda *_: [replace(start, robot=robot)])
    monkeypatch.setattr(robot_effects, "_ROUNDS", 0)
    monkeypatch.setattr(robot_effects, "robot_deviations", lambda *_: np.full(len(ROBOT_NUMBERS), math.inf))
    monkeypatch.setattr(pipeline, "robot_of", lambda *_: (None, "not fitted alone"))
    monkeypatch.setattr(report, "on_rollers", lambda model, *_: (model, "not simulated on rollers"))
    fit = fit_dataset(logs, FitOptions(starts=1))
    assert fit.robot is not None
    assert fit.robot.robot.servo_windup == 1.0
    assert any("winds up at the torque limit (servo_windup 1)" in note for note in fit.notes)
    assert fitted_model(fit).robot == fit.robot.robot


def with_ceiling(model: Model, saturation_rpm: float) -> Model:
    return replace(model, wheel=replace(model.wheel, saturation_rpm=saturation_rpm))


@pytest.mark.parametrize(("cost_without", "stays"), [(0.99, True), (0.9, False)])
def test_the_ceiling_is_lifted_only_where_logs_are_predicted_clearly_better_without(
    logs: Dataset, monkeypatch: pytest.MonkeyPatch, cost_without: float, stays: bool
) -> None:
    starts: list[module._Start] = []

    def descended(_: object, start: module._Start, *__: object) -> module._Start:
        starts.append(start)
        return replace(start, cost=cost_without if math.isinf(start.base.wheel.saturation_rpm) else 1.0)

    monkeypatch.setattr(module, "_descended", descended)
    monkeypatch.setattr(module, "_TRIED", 8)
    asked = max(float(np.max(np.abs(run.command.wheels_rpm))) for run in logs.runs)
    model = with_ceiling(paper_model(), 0.98 * asked)
    for found in simple_robots(model, ("friction",), wheels_of(logs)):
        assert math.isfinite(found.wheel.saturation_rpm) is stays
    # The ceiling has its chance from where the descent without it ended.
    last, lifted = starts[-1], [one for one in starts if math.isinf(one.base.wheel.saturation_rpm)]
    assert last.base.wheel.saturation_rpm == model.wheel.saturation_rpm
    assert any(last.place is one.place for one in lifted)


def test_a_ceiling_below_the_commands_is_found(
    limited: Model, start: Model, robot_logs: Callable[..., Dataset], monkeypatch: pytest.MonkeyPatch
) -> None:
    logs = robot_logs(with_ceiling(limited, 80.0), runs=4, seconds=2.5)
    known = tuple(name for name in robot_effects._KNOWN if name in ("command_latency", "speed_saturation"))
    monkeypatch.setattr(robot_effects, "simple_robots", lambda *_: [with_ceiling(start, math.inf)])
    monkeypatch.setattr(robot_effects, "_KNOWN", known)
    monkeypatch.setattr(robot_effects, "_ROUNDS", 1)
    found = find_robot_effects(logs, with_ceiling(paper_model(), math.inf), (), wheels_of(logs))
    assert found is not None
    assert found.drive.model.effects["speed_saturation"]["limit_rpm"] == pytest.approx(80.0, rel=0.03)
    assert found.after < 1.3


def test_what_fits_the_fit_runs_only_is_not_taken(
    logs: Dataset, start: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first set has the best price, and another one predicts the validation runs far better."""
    held_out = 2.0, 1.0
    monkeypatch.setattr(robot_effects, "simple_robots", lambda *_: [start])
    monkeypatch.setattr(
        robot_effects, "searched", lambda _, began, *__: [replace(began[0], held_out=one) for one in held_out]
    )
    found = find_robot_effects(logs, paper_model(), (), wheels_of(logs))
    assert found is not None
    assert found.after == 1.0


@pytest.mark.parametrize("body", [False, True])
def test_times_of_sensors_are_tried_where_logs_show_more_than_the_wheels(
    limited: Model, robot_logs: Callable[..., Dataset], monkeypatch: pytest.MonkeyPatch, body: bool
) -> None:
    def told(start: Model, _: object) -> Model:
        tried.append(start)
        return late

    def ended(searches: Sequence[EffectSearch], *_: object) -> list[Reached]:
        begun.extend(one.base for one in searches)
        return []

    tried: list[Model] = []
    begun: list[Model] = []
    late = limited.with_effect("sensor_latency/wheels", delay_s=0.02)
    logs = robot_logs(limited, runs=3, seconds=1.5, body=body)
    monkeypatch.setattr(robot_effects, "simple_robots", lambda *_: [limited])
    monkeypatch.setattr(robot_effects, "with_sensor_times", told)
    monkeypatch.setattr(robot_effects, "searched", ended)
    assert find_robot_effects(logs, paper_model(), (), wheels_of(logs)) is None
    assert tried == ([limited] if body else [])
    assert ("sensor_latency/wheels" in begun[0].effects) is body


def test_the_model_states_one_covariance_of_law_and_effects(found: RobotWithEffects | None) -> None:
    assert found is not None
    stated = found.drive.model.uncertainty["joint"]
    assert stated["names"][:6] == list("ABCDEF")
    assert np.array(stated["covariance"]).shape == (len(stated["names"]),) * 2


def test_a_robot_that_its_law_explains_has_no_effects(robot_logs: Callable[..., Dataset]) -> None:
    data = robot_logs(paper_model(), runs=3, seconds=1.5)
    assert find_robot_effects(data, paper_model(), (), wheels_of(data)) is None


def test_what_the_rollers_move_is_stated_where_it_is(
    logs: Dataset, found: RobotWithEffects | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert found is not None
    monkeypatch.setattr(robot_parameters, "_SIMULATIONS", 3)
    late = found.drive.model.with_effect("command_latency", delay_s=0.1)
    model, note = robot_parameters.on_rollers(late, logs, ())
    assert "there the error on validation runs is" in note
    assert model.effects["command_latency"]["delay_s"] < 0.09
    for name, parameters in model.uncertainty["effects"].items():
        for parameter, ends in parameters.items():
            assert ends["value"] == pytest.approx(model.effects[name][parameter])
