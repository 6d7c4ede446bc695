"""The next experiment: within its limits, reproducible, of the power it states, and decisive."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from scipy.stats import norm

from mecanum_env.effects import CATALOGUE
from mecanum_env.kinematics import command_to_wheels
from mecanum_env.model import Model, Robot
from mecanum_env.simulator import RobotPlant
from mecanum_env.simulator.bench import replay_bench
from sysid.compare.least_squares import ResidualProblem
from sysid.compare.measured import Start, observe
from sysid.compare.model_error import Whitener
from sysid.compare.noise import Noise
from sysid.compare.predicted import SimulationSettings, predict
from sysid.compare.search_space import scale_of
from sysid.gap.design.experiment import Rival, design_separating, power, separation
from sysid.gap.design.limits import Limits
from sysid.gap.design.next_experiment import conditions_of, design_for_untestable
from sysid.gap.design.sequences import FIELD_M, changed, library, path_m
from sysid.gap.design.trial import EFFORT, DesignEffort, ExperimentConditions, Trial, command_of
from sysid.gap.result import GapOptions
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.gap.wording import what_to_measure
from sysid.gap.workflow import analyse
from sysid.logs import BenchCommand, BodyCommand, Dataset, Run

BENCH = Limits(135.0)
ROBOT = Limits(135.0, geometry=Robot())


def bench_conditions(sigma_rpm: float = 0.5, seed: int = 0, jobs: int = 1) -> ExperimentConditions:
    noise = Noise({"speed_rpm": sigma_rpm}, {"speed_rpm": "repeats"})
    return ExperimentConditions(
        "bench", ("speed_rpm",), 0.01, noise, None, BENCH, SimulationSettings(seed=seed, jobs=jobs)
    )


def robot_conditions(plant: RobotPlant = "rollers", **sigma: float) -> ExperimentConditions:
    noise = Noise(sigma, dict.fromkeys(sigma, "repeats"))
    return ExperimentConditions("body", tuple(sigma), 0.02, noise, None, ROBOT, SimulationSettings(plant))


def rivals(model: Model, friction_n_m: float = 0.5) -> tuple[Rival, Rival]:
    """Return friction and the gain that looks like it at 60 rpm, each with its uncertain parameter."""

    def friction(torque: float) -> Model:
        return model.with_effect("coulomb_friction", torque_n_m=torque)

    def gain(value: float) -> Model:
        return model.with_effect("speed_gain", gain=value)

    like = 1.0 - friction_n_m / model.robot.servo_n_m_s_rad * 30.0 / np.pi / 60.0
    return (
        Rival(("coulomb_friction",), friction(friction_n_m), (friction(1.01 * friction_n_m),)),
        Rival(("speed_gain",), gain(like), (gain(like + 2e-4),)),
    )


def sequences(limits: Limits) -> list[np.ndarray]:
    rng = np.random.default_rng(0)
    found = library(limits, rng)
    return [*found, *(r for s in found * 5 if (r := changed(s, limits, rng)) is not None)]


@pytest.mark.parametrize("limits", [BENCH, ROBOT, Limits(97.5, 2.0)])
def test_every_sequence_is_one_that_the_robot_takes(limits: Limits):
    for rows in sequences(limits):
        assert len(rows) <= limits.max_rows
        assert np.all(rows[:2] == 0.0)
        assert np.all(rows[-1] == 0.0)
        speeds = rows if rows.shape[1] == 1 else rows[:, [0, 2]]
        assert np.all(speeds % limits.quantum_rpm == 0.0)
        wheels = rows if rows.shape[1] == 1 else command_to_wheels(*rows.T)
        assert np.max(np.abs(wheels)) <= limits.limit_rpm + 1e-9


def test_robot_sequences_take_whole_degrees_and_stay_in_the_field():
    for rows in sequences(ROBOT):
        assert np.all(rows[:, 1] == np.rint(rows[:, 1]))
        assert np.all(rows[:, 0] >= 0.0)
        assert np.max(np.abs(path_m(rows, Robot(), 0.1))) < 0.5 * FIELD_M


def test_the_path_of_a_turn_and_a_straight_is_where_geometry_says():
    quarter_s = 0.5 * np.pi / (60.0 * np.pi / 30.0 * 0.0762 / 0.38)
    rows = np.array([[0.0, 0.0, 60.0], [60.0, 0.0, 0.0]])
    path = path_m(rows, Robot(), quarter_s)
    assert path[-1] == pytest.approx([0.0, 60.0 * np.pi / 30.0 * 0.0762 * quarter_s], abs=1e-12)


def test_wheel_commands_are_whole_too():
    rows = np.array([[50.0, 33.0, 7.0], [0.0, 0.0, 0.0]])
    columns = command_of(rows, replace(robot_conditions(), kind="wheels")).columns()
    assert list(columns) == [f"command_{wheel}_rpm" for wheel in ("fl", "fr", "rl", "rr")]
    assert all(np.all(values == np.rint(values)) for values in columns.values())


def test_the_same_seed_gives_the_same_experiment_whatever_the_jobs(
    paper: Model, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setitem(EFFORT, "bench", DesignEffort(4, 2, 3))
    noisy = [bench_conditions(8.0, seed=3, jobs=jobs) for jobs in (1, 2)]
    one, two = (design_separating(paper, rivals(paper), some).experiment for some in noisy)
    assert one is not None
    assert two is not None
    assert one.power == two.power < 0.999  # so that it had to be improved, at random
    assert np.array_equal(one.columns["command_rpm"], two.columns["command_rpm"])


def test_the_experiment_separates_better_than_a_step(paper: Model):
    found = design_separating(paper, rivals(paper), bench_conditions()).experiment
    assert found is not None
    step = np.concatenate([np.zeros((2, 1)), np.full((56, 1), 60.0), np.zeros((2, 1))])
    designed, plain = (
        separation(Trial(paper, rows, bench_conditions()), paper, rivals(paper), thorough=True)
        for rows in (found.columns["command_rpm"][:, None], step)
    )
    assert np.min(designed) > np.min(plain) + 2.0
    assert found.power > 0.99
    assert set(found.predicted) == {"coulomb_friction", "speed_gain"}


def test_power_is_the_share_of_simulated_experiments_that_leave_the_truth_alone(paper: Model):
    """Draw noise, refit each candidate's parameter, and decide as a study does."""
    noisy = bench_conditions(4.0)
    rows = np.concatenate([np.zeros(2), np.repeat([5.0, -5.0, 90.0, 0.0], 5), np.zeros(2)])[:, None]
    both = rivals(paper)
    trial = Trial(paper, rows, noisy)
    z = separation(trial, paper, both, thorough=True)
    shown = [trial.whitened(rival.model) for rival in both]
    moved = [trial.differences(p, r.plausible) for p, r in zip(shown, both, strict=True)]
    rng = np.random.default_rng(0)
    for index, (truth, rival) in enumerate(permutations(range(2))):
        explained = trial.squared_distance(shown[truth] - trial.whitened(paper))
        limit = THRESHOLDS.tie_sigmas**2 + THRESHOLDS.formula_error**2 * explained
        alone = 0
        for _ in range(4000):
            measured = shown[truth] + rng.standard_normal(shown[truth].size)
            cost = [trial.squared_distance(measured - shown[i], moved[0], moved[1]) for i in (truth, rival)]
            alone += cost[1] - cost[0] > limit
        assert 0.2 < norm.cdf(z[index]) < 0.98
        assert alone / 4000 == pytest.approx(norm.cdf(z[index]), abs=0.03)


def test_power_is_that_of_the_truth_worst_off():
    separable = np.array([True, True, True, True, False, False])
    z = norm.ppf([0.99, 0.98, 0.9, 0.95, 0.1, 0.1])
    assert power(z, separable, 3) == pytest.approx(0.85)


@pytest.mark.parametrize(
    ("one", "other", "needed"),
    [
        (("command_latency", {"delay_s": 0.03}), ("sensor_latency", {"delay_s": 0.03}), "time stamps"),
        (("speed_gain", {"gain": 0.95}), ("sensor_scale", {"wheel": 0.95}), "tachometer"),
    ],
)
def test_exact_twins_get_no_experiment_but_what_to_measure(paper: Model, one, other, needed: str):
    twins = [Rival((name,), paper.with_effect(name, **values)) for name, values in (one, other)]
    found = design_separating(paper, twins, bench_conditions())
    assert found.experiment is None
    assert "No command" in found.why
    assert needed in found.why


def test_an_experiment_that_would_leave_the_question_open_is_not_offered(paper: Model):
    """Studies asked for experiments with a promised power of 3e-8, and 0 for others."""
    assert design_separating(paper, rivals(paper), bench_conditions(8.0)).experiment is not None
    found = design_separating(paper, rivals(paper, 0.02), bench_conditions(40.0))
    assert found.experiment is None
    assert "tells coulomb_friction or speed_gain apart" in found.why
    assert "with a probability of 50%: measure" in found.why
    assert CATALOGUE["speed_gain"].direct_check in found.why


def test_pairs_that_cannot_be_told_apart_do_not_cost_the_others_their_experiment(paper: Model):
    """Two gains that differ by nothing: the experiment still sets the friction apart from both."""
    friction, gain = rivals(paper)
    same = Rival(("sensor_scale",), gain.model, gain.plausible)
    found = design_separating(paper, (friction, gain, same), bench_conditions())
    assert found.experiment is not None
    assert found.experiment.power > 0.99
    assert "tells speed_gain or sensor_scale apart" in found.why
    assert "tells coulomb_friction" not in found.why


def test_every_effect_has_a_direct_check():
    assert all(effect.direct_check for effect in CATALOGUE.values())
    assert "tape" in what_to_measure([("wheel_radius",), ("speed_gain",)], ("x_m", "y_m", "yaw_rad"))


def test_a_robot_experiment_stays_in_the_field_and_slips_no_wheel(
    paper: Model, monkeypatch: pytest.MonkeyPatch
):
    some = library(ROBOT, np.random.default_rng(0))[4::7]
    monkeypatch.setattr("sysid.gap.design.trial.library", lambda *_: some)
    monkeypatch.setitem(EFFORT, "robot", DesignEffort(2, 1, 1))
    conditions = robot_conditions(speed_fl_rpm=0.5, vx_m_s=0.01, vy_m_s=0.01)
    slope = paper.with_effect("floor_slope", slope_deg=1.0, heading_deg=0.0)
    offset = paper.with_effect("com_offset", x_m=0.02, y_m=0.0)
    both = [Rival(("floor_slope",), slope), Rival(("com_offset",), offset)]
    found = design_separating(paper, both, conditions).experiment
    assert found is not None
    assert found.power > 0.9
    assert list(found.columns) == ["command_v_rpm", "command_theta_deg", "command_vc_rpm"]
    for shown in found.predicted.values():
        assert max(np.max(np.abs(shown["x_m"])), np.max(np.abs(shown["y_m"]))) < 0.5 * FIELD_M - 0.3
    trial = Trial(slope, np.stack(list(found.columns.values()), axis=1), conditions)
    assert trial.predictable(slope, trial.whitened(slope))


def test_full_reversals_on_the_floor_cannot_be_predicted(paper: Model):
    conditions = robot_conditions(speed_fl_rpm=0.5)
    rows = np.repeat([[0.0, 0.0, 0.0], [135.0, 0.0, 0.0], [135.0, 180.0, 0.0], [135.0, 0.0, 0.0]], 8, axis=0)
    trial = Trial(paper, rows, conditions)
    assert not trial.predictable(paper, trial.whitened(paper))


def test_a_study_without_slip_designs_on_the_planar_plant(paper: Model):
    rows = np.repeat([[0.0, 0.0, 0.0], [60.0, 45.0, 0.0], [0.0, 0.0, 0.0]], 4, axis=0)
    trial = Trial(paper, rows, robot_conditions("planar", speed_fl_rpm=0.5), coarse=True)
    predicted = trial.predict(paper)
    assert predicted is not None
    planar = predict(paper, trial.run, Start(), settings=SimulationSettings(plant="planar"))
    assert np.array_equal(predicted["speed_fl_rpm"], planar["speed_fl_rpm"])


def test_the_conditions_of_an_experiment_hold_the_whole_study(paper: Model):
    """Plant, jobs, time step, seed and scale: a design that lost one would simulate another robot."""
    observations = observe(Dataset("robot", (planar_run(paper),), ()))
    noise = Noise({"speed_fl_rpm": 0.5}, {"speed_fl_rpm": "repeats"})
    settings = SimulationSettings("planar", jobs=2, timestep_s=1 / 480, seed=5)
    problem = ResidualProblem(paper, Whitener(observations, noise, None), settings)
    used = conditions_of(problem, (planar_run(paper),), 1.0).settings
    assert used == problem.settings == replace(settings, scale=used.scale)
    assert used.scale == scale_of(paper, (planar_run(paper),))


def test_slip_effects_are_not_designed_for_without_slip(paper: Model):
    conditions = robot_conditions("planar", speed_fl_rpm=0.5)
    found = design_for_untestable(paper, ["low_grip"], conditions, 12.0)
    assert (found.experiment, found.why) == (None, "")


def test_untestable_effects_get_commands_that_show_them(paper: Model):
    found = design_for_untestable(
        paper, ["direction_asymmetry", "speed_saturation", "payload"], bench_conditions(), 12.0
    ).experiment
    assert found is not None
    assert found.power > 0.99
    assert np.min(found.columns["command_rpm"]) < 0.0
    assert "payload" not in found.why
    assert found.candidates == ()


def planar_run(model: Model) -> Run:
    time = np.arange(0.0, 1.0, 0.02)
    command = BodyCommand(np.full(time.size, 60.0), np.zeros(time.size), np.zeros(time.size))
    empty = Run("a.csv", "a", "fit", time, command, {"speed_fl_rpm": np.zeros(time.size)})
    return replace(
        empty, channels=predict(model, empty, Start(), settings=SimulationSettings(plant="planar"))
    )


def logs_of(model: Model, plans: dict[str, tuple[str, np.ndarray]], seed: int) -> tuple[Run, ...]:
    rng = np.random.default_rng(seed)
    runs = []
    for name, (split, commands) in plans.items():
        time = np.arange(10 * len(commands) + 1) * 0.01
        command = np.append(np.repeat(commands, 10), commands[-1])
        speed = replay_bench(model, time, command)
        for repeat in range(3):
            noisy = {"speed_rpm": np.round(speed + 0.5 * rng.standard_normal(time.size), 2)}
            runs.append(Run(f"{name}_{repeat}.csv", name, split, time, BenchCommand(command), noisy))
    return tuple(runs)


def test_feeding_the_experiment_back_settles_an_ambiguous_study(paper: Model):
    hidden = paper.with_effect("coulomb_friction", torque_n_m=0.1)
    step = np.concatenate([np.zeros(2), np.full(12, 60.0)])
    gentle = logs_of(hidden, {"a": ("fit", step), "b": ("validation", step), "c": ("test", step)}, 0)
    options = GapOptions(only=("coulomb_friction", "speed_gain"))
    before = analyse(Dataset("gentle", gentle, ()), paper, options)
    assert before.verdict == "ambiguous"
    assert before.next_experiment is not None
    assert before.next_experiment.power > 0.9
    commands = before.next_experiment.columns["command_rpm"]
    assert np.max(np.abs(commands)) <= 60.0
    more = logs_of(hidden, {"next": ("fit", commands)}, 1)
    after = analyse(Dataset("with the experiment", gentle + more, ()), paper, options)
    assert after.verdict == "named"
    assert after.candidates == (("coulomb_friction",),)
    assert after.effects[0].parameters["torque_n_m"].value == pytest.approx(0.1, abs=0.02)
