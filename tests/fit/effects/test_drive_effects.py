"""Law and effects of a drive, fitted together: found where they are, left out where the law is enough."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mecanum_env.effects.friction import droop_rpm
from mecanum_env.model import cause_of, model_to_dict
from mecanum_env.simulator import SimulationDivergedError, replay_bench
from mecanum_env.units import RAD_S_PER_RPM
from sysid.compare.measured import observe
from sysid.compare.predicted import predict_all
from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.fit.effects import HeldOut, drive, find_drive_effects, has_unasked_ceiling
from sysid.fit.effects.ceiling import HeldSpeeds
from sysid.fit.report import fit_json, fit_table, stated, write_fit_report
from sysid.logs import BenchCommand, Dataset, Run
from sysid.studies.zoo.cases.write import write_bench_case
from sysid.studies.zoo.nominal import nominal_model

SAMPLE_S, SECONDS = 1.0 / 120.0, 2.5
SPLITS = ("fit", "fit", "fit", "fit", "validation", "validation", "test")
NOISE_RPM = 0.3


def logs(model, seed: int = 0, battery_v=None) -> Dataset:
    """Return seven sequences of commands, each driven twice by a model, with noise; `battery_v` is logged."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(round(SECONDS / SAMPLE_S) + 1) * SAMPLE_S
    runs = []
    for number, split in enumerate(SPLITS):
        levels = np.concatenate([[0], rng.integers(-110, 111, 7)]).astype(float)
        command = levels[np.minimum((time_s / 0.3 + 1e-9).astype(int), 7)]
        speed = replay_bench(model, time_s, command, battery_v=battery_v)
        for repeat in (1, 2):
            noisy = speed + NOISE_RPM * rng.standard_normal(speed.size)
            name = f"run_{number}_{repeat}.csv"
            channels = {"speed_rpm": noisy} | ({} if battery_v is None else {"battery_v": battery_v})
            runs.append(Run(name, f"run_{number}", split, time_s, BenchCommand(command), channels))
    return Dataset("made", tuple(runs), ())


@pytest.fixture(scope="module")
def rubbing(paper_module):
    """Return a drive that reaches 0.9 of its command and rubs, and the fit of its logs."""
    soft = replace(paper_module, robot=replace(paper_module.robot, servo_n_m_s_rad=0.5))
    true = soft.with_effect("speed_gain", gain=0.9).with_effect("coulomb_friction", torque_n_m=0.4)
    return true, fit_dataset(logs(true), FitOptions(starts=2, robot=soft.robot))


@pytest.fixture(scope="module")
def paper_module():
    from mecanum_env.model import paper_model

    return paper_model()


def test_a_drive_that_is_its_law_has_no_effects(paper_module):
    fit = fit_dataset(logs(paper_module), FitOptions(starts=2))
    assert fit.drive_effects is None
    assert dict(fitted_model(fit).effects) == {}
    assert fit_json(fit)["drive_effects"] is None


def test_friction_and_gain_are_fitted_together_with_the_law(rubbing):
    _, fit = rubbing
    found = fit.drive_effects
    assert found is not None
    model = fitted_model(fit)
    assert model.effects["speed_gain"]["gain"] == pytest.approx(0.9, abs=0.02)
    assert "coulomb_friction" in model.effects
    assert found.before_rpm > 3.0 * found.after_rpm
    assert any("fitted together with the law" in note for note in fit.notes)


def test_the_files_tell_what_the_model_with_effects_does_beside_the_law_alone(rubbing):
    _, fit = rubbing
    model = fitted_model(fit)
    content = fit_json(fit, model)
    told = content["model"]
    assert told == fit_json(fit)["model"]
    assert list(told["coefficients"].values()) == model.wheel.law.coefficients.tolist()
    friction = told["effects"]["coulomb_friction"]
    assert friction.pop("droop_rpm") == pytest.approx(friction["torque_n_m"] / 0.5 / RAD_S_PER_RPM)
    assert told["effects"] == model_to_dict(model)["effects"]
    assert told["rms_rpm"]["validation"] < 0.5 * content["methods"]["output-error"]["rms_rpm"]["validation"]
    row = next(line.split() for line in fit_table(fit, model).splitlines() if line.startswith("with effects"))
    assert row[2:5] == [f"{told['rms_rpm'][split]:.3f}" for split in ("fit", "validation", "test")]


def test_test_runs_that_the_model_cannot_follow_do_not_end_the_report(rubbing, monkeypatch, tmp_path):
    _, fit = rubbing
    model, test = fitted_model(fit), {run.file for run in fit.dataset.split("test")}

    def astray(model, runs):
        if test & {run.file for run in runs}:
            raise SimulationDivergedError("the simulation diverged")
        return predict_all(model, runs)

    monkeypatch.setattr(stated, "predict_all", astray)
    assert set(fit_json(fit, model)["model"]["rms_rpm"]) == {"fit", "validation"}
    assert "with effects" in fit_table(fit, model)
    write_fit_report(fit, model, tmp_path / "report.html")


def test_the_page_shows_the_model_with_effects_beside_the_law_alone(rubbing, tmp_path):
    _, fit = rubbing
    write_fit_report(fit, fitted_model(fit), tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "green the model with the effects that were fitted together" in page
    assert page.count('"with effects"') == page.count('"law alone"') == 6


def test_the_model_with_effects_predicts_runs_that_nothing_was_fitted_to(rubbing):
    true, fit = rubbing
    model = fitted_model(fit)
    test = logs(true, seed=1).runs[-1]
    predicted = replay_bench(model, test.time_s, test.command.wheels_rpm[:, 0])
    error = np.sqrt(np.mean((predicted - test.channels["speed_rpm"]) ** 2))
    assert error < 3.0 * NOISE_RPM


def test_a_drive_whose_gain_follows_the_logged_voltage_is_fitted_with_it(paper_module):
    volts = 24.0 - 2.0 * np.sin(np.linspace(0.0, np.pi, round(SECONDS / SAMPLE_S) + 1))
    true = paper_module.with_effect("battery_sag", "voltage", per_volt=0.05)
    found = fit_dataset(logs(true, battery_v=volts), FitOptions(starts=2)).drive_effects
    # A law that is fitted without the voltage takes the mean loss for a gain; with it, none is left.
    effects = dict(found.model.effects)
    assert effects.pop("speed_gain", {"gain": 1.0})["gain"] == pytest.approx(1.0, abs=0.005)
    assert set(effects) == {"battery_sag/voltage"}
    assert found.model.effects["battery_sag/voltage"]["per_volt"] == pytest.approx(0.05, abs=0.003)


def test_the_law_alone_is_fitted_on_request(rubbing):
    true, _ = rubbing
    fit = fit_dataset(logs(true), FitOptions(starts=2, effects="off", robot=true.robot))
    assert fit.drive_effects is None


def test_what_was_found_is_stated_with_its_uncertainty(rubbing):
    _, fit = rubbing
    model = fitted_model(fit)
    stated = model.uncertainty["effects"]["speed_gain"]["gain"]
    assert stated["low"] < model.effects["speed_gain"]["gain"] < stated["high"]
    assert np.all(np.linalg.eigvalsh(np.array(model.uncertainty["wheel"]["covariance"])) > -1e-9)


def test_law_and_effects_are_stated_with_one_covariance(rubbing):
    _, fit = rubbing
    uncertainty = fitted_model(fit).uncertainty
    names, covariance = uncertainty["joint"]["names"], np.array(uncertainty["joint"]["covariance"])
    assert names[:6] == list("ABCDEF")
    assert {"speed_gain.gain", "coulomb_friction.torque_n_m"} <= set(names)
    assert np.array_equal(covariance[:6, :6], np.array(uncertainty["wheel"]["covariance"]))
    ends = uncertainty["effects"]["speed_gain"]["gain"]
    deviation = np.sqrt(covariance[names.index("speed_gain.gain"), names.index("speed_gain.gain")])
    assert ends["high"] - ends["low"] == pytest.approx(2.0 * 1.645 * deviation, rel=1e-3)
    assert np.any(covariance[:6, 6:] != 0.0)


def test_a_gain_is_not_imitated_by_a_pole_that_no_hold_shows(paper_module):
    law = replace(paper_module.wheel.law, A=0.85, B=0.0, C=0.0, D=0.15, E=0.0, F=0.0)
    true = replace(paper_module, wheel=replace(paper_module.wheel, law=law)).with_effect(
        "speed_gain", gain=0.8
    )
    found = fitted_model(fit_dataset(logs(true), FitOptions(starts=2)))
    assert found.effects["speed_gain"]["gain"] == pytest.approx(0.8, abs=0.02)
    held_s = np.arange(600) * SAMPLE_S
    speeds = [replay_bench(model, held_s, np.full(600, 100.0))[-1] for model in (true, found)]
    assert speeds[1] == pytest.approx(speeds[0], abs=2.0)


def test_a_law_that_predicts_the_validation_runs_better_than_what_is_found_stays(paper_module):
    runs = logs(paper_module).runs
    # The fit runs alone are of a drive that reaches 0.7 of its command.
    other = logs(paper_module.with_effect("speed_gain", gain=0.7)).runs
    mixed = [new if run.split == "fit" else run for run, new in zip(runs, other, strict=True)]
    no_such_pole = 0.99 * float(np.max(np.abs(paper_module.wheel.law.poles)))
    assert find_drive_effects(Dataset("mixed", tuple(mixed), ()), paper_module, (), no_such_pole) is None


@pytest.mark.parametrize(
    ("share", "beside", "named"),
    [
        (0.85, 0.5, {"backlash"}),
        (0.95, 0.5, {"coulomb_friction"}),
        # What predicts worse than the law alone does not take its place: the gap is judged beside that.
        (0.85, 1.5, {"backlash"}),
        (0.95, 1.5, set()),
        # Nothing else is found.
        (0.85, None, {"backlash"}),
        (0.95, None, set()),
    ],
)
def test_a_gap_is_named_only_where_nothing_else_predicts_as_well(
    monkeypatch, paper_module, share, beside, named
):
    """Quick reversals hardly show a gap, and slow ones, of which the logs have none, consist of it.

    With a gap the error is a `share` of that without; what is found without is `beside` times the law alone.
    """
    data = logs(paper_module)
    alone = HeldOut.of(data).errors(paper_module)[0]
    friction = paper_module.with_effect("coulomb_friction", torque_n_m=0.1)
    gap = paper_module.with_effect("backlash/rest", gap_deg=20.0)

    def found_set(model, held):
        return SimpleNamespace(
            model=model, held_out=held, held_out_rpm=held, stated=lambda: (model, np.zeros((6, 6)))
        )

    def searched(searches, *_):
        if any(effect.cause == "backlash" for search in searches for effect in search.known.values()):
            return [found_set(gap, share * min(beside or 1.0, 1.0) * alone)]
        return [] if beside is None else [found_set(friction, beside * alone)]

    monkeypatch.setattr(drive, "searched", searched)
    monkeypatch.setattr(drive, "in_place_of", lambda _, reached, *__, **___: next(iter(reached), None))
    found = find_drive_effects(data, paper_module)
    assert (set() if found is None else {cause_of(name) for name in found.model.effects}) == named


@pytest.mark.slow
def test_a_drive_without_play_that_was_logged_slowly_is_fitted_without_a_gap(tmp_path):
    case = write_bench_case(2066, tmp_path)
    assert case.kind == "quiet"
    assert "backlash" not in {cause_of(name) for name in nominal_model(tmp_path).effects}


@pytest.mark.parametrize(
    ("form", "limit_rpm", "gain", "unasked"),
    [
        ("clip", 91.0, 1.0, True),
        ("supply", 86.0, 1.0, True),
        ("clip", 75.0, 1.0, False),
        ("clip", 91.0, 0.8, False),
    ],
)
def test_a_ceiling_that_no_command_goes_beyond_is_none(paper_module, form, limit_rpm, gain, unasked):
    name = "speed_saturation" if form == "clip" else f"speed_saturation/{form}"
    model = paper_module.with_effect("speed_gain", gain=gain).with_effect(name, limit_rpm=limit_rpm)
    assert has_unasked_ceiling(model, 90.0) is unasked
    assert not has_unasked_ceiling(paper_module, 90.0)


@pytest.mark.parametrize(
    ("limit_rpm", "softness_rpm", "unasked"),
    [(110.0, 25.0, True), (110.0, 15.0, False), (80.0, 15.0, True), (70.0, 15.0, False)],
)
def test_a_soft_ceiling_of_which_the_logs_reach_the_knee_alone_is_none(
    paper_module, limit_rpm, softness_rpm, unasked
):
    """The knee ends as far beyond the limit as it begins below it."""
    model = paper_module.with_effect("speed_saturation", limit_rpm=limit_rpm, softness_rpm=softness_rpm)
    assert has_unasked_ceiling(model, 90.0) is unasked


@pytest.mark.parametrize(("rise", "is_none"), [(0.0, False), (0.4, True)])
def test_a_ceiling_beyond_which_speeds_still_rise_with_the_command_is_none(paper_module, rise, is_none):
    """They bend: a fit would end the curve at the fastest speed of its logs."""
    time_s = 0.02 * np.arange(100)
    runs = []
    for number, level in enumerate((60.0, -85.0, 95.0, -105.0)):
        speed = np.copysign(min(abs(level), 80.0 + rise * (abs(level) - 80.0)), level)
        channels = {"speed_rpm": np.where(time_s > 0.2, speed, 0.0)}
        command = BenchCommand(np.full(time_s.size, level))
        runs.append(Run(f"{number}.csv", f"{number}", "fit", time_s, command, channels))
    held = HeldSpeeds.of(observe(Dataset("made", tuple(runs), ())))
    model = paper_module.with_effect("speed_saturation", limit_rpm=80.0)
    assert held.rise_beyond_ceiling(model) is is_none
    assert not held.rise_beyond_ceiling(paper_module)


def test_a_ramp_behind_a_delay_is_found_although_the_law_alone_imitates_both(paper_module):
    true = paper_module.with_effect("command_latency", delay_s=0.12)
    true = true.with_effect("acceleration_limit", limit_rpm_s=350.0)
    fit = fit_dataset(logs(true), FitOptions(starts=2))
    model = fitted_model(fit)
    assert model.effects["command_latency"]["delay_s"] == pytest.approx(0.12, abs=0.02)
    assert model.effects["acceleration_limit"]["limit_rpm_s"] == pytest.approx(350.0, rel=0.05)
    assert fit.drive_effects.after_rpm < 0.2 * fit.drive_effects.before_rpm


def steps_from_rest(model, sample_s: float = 0.03) -> Dataset:
    """Return steps of a model from rest and back, with noise, in samples as far apart as a rise takes."""
    rng = np.random.default_rng(0)
    time_s = np.arange(round(1.8 / sample_s)) * sample_s
    runs = []
    for number, level in enumerate((20.0, -35.0, 110.0, -95.0, 65.0, -50.0)):
        command = np.where((time_s > 0.2) & (time_s < 1.4), level, 0.0)
        speed = replay_bench(model, time_s, command) + 3.0 * NOISE_RPM * rng.standard_normal(time_s.size)
        name, split = f"run_{number}", ("fit", "validation")[number > 3]
        runs.append(Run(f"{name}.csv", name, split, time_s, BenchCommand(command), {"speed_rpm": speed}))
    return Dataset("steps", tuple(runs), ())


def test_a_motor_s_friction_is_fitted_as_friction_and_not_as_a_dead_zone(paper_module):
    law = replace(paper_module.wheel.law, A=0.3, B=0.0, C=0.0, D=0.7, E=0.0, F=0.0)
    fast = replace(paper_module, wheel=replace(paper_module.wheel, law=law))
    torque = 3.0 * RAD_S_PER_RPM * fast.robot.servo_n_m_s_rad
    logs = steps_from_rest(fast.with_effect("coulomb_friction", torque_n_m=torque))
    found = fit_dataset(logs, FitOptions(starts=1)).drive_effects
    assert found is not None
    assert "command_deadband/subtract" not in found.model.effects
    friction = found.model.effects["coulomb_friction"]
    assert droop_rpm("coulomb_friction", friction, found.model) == pytest.approx(3.0, abs=0.3)
