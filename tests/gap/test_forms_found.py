"""Parameters and forms that a search finds on bench logs, each hidden alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import pytest

from mecanum_env.model import Model, paper_model
from sysid.compare.least_squares import ResidualProblem
from sysid.compare.measured import observe
from sysid.compare.model_error import Whitener
from sysid.compare.noise import measure_noise
from sysid.fit.effects.pi_drive import pi_law
from sysid.gap.search.responses import Library, responses
from sysid.gap.search.sets import Search
from sysid.gap.search.thresholds import SearchEffort

from .conftest import MakeLogs

MODEL = paper_model()
RUBBING = MODEL.with_effect("coulomb_friction", torque_n_m=8.0)


def found(
    make: MakeLogs, base: Model, name: str, hidden: Mapping[str, float]
) -> tuple[float, dict[str, float]]:
    """Return the mean square that the search leaves of an effect alone, and the values that it finds."""
    logs = make(base.with_effect(name, **hidden), noise_rpm=0.2)
    observations = observe(replace(logs, runs=tuple(run for run in logs.runs if run.split != "test")))
    problem = ResidualProblem(base, Whitener(observations, measure_noise(logs, observations), None))
    search = Search(problem, Library(responses(problem, [name])), SearchEffort())
    search.grow(1)
    (fitted,) = search.of_size(1)
    search.leave_out_needless(1, 1.0)
    model = search.of_size(1)[0].candidate.model(base, search.of_size(1)[0].place)
    return fitted.cost / problem.size, dict(model.effects[name])


@pytest.mark.parametrize("form", ["acceleration_limit", "acceleration_limit/drive"])
@pytest.mark.parametrize("brake", [250.0, 1100.0])
def test_a_brake_of_its_own_is_found(bench_logs: MakeLogs, form: str, brake: float) -> None:
    left, values = found(bench_logs, MODEL, form, {"limit_rpm_s": 500.0, "brake_rpm_s": brake})
    assert left < 1.3
    assert values["limit_rpm_s"] == pytest.approx(500.0, rel=0.05)
    assert values["brake_rpm_s"] == pytest.approx(brake, rel=0.05)


@pytest.mark.parametrize("windup", [0.0, 1.0])
@pytest.mark.parametrize(
    ("name", "limit"),
    [
        ("speed_saturation/supply", {"limit_rpm": 70.0}),
        ("acceleration_limit/drive", {"limit_rpm_s": 250.0, "brake_rpm_s": 250.0}),
    ],
)
def test_a_limit_tells_whether_the_integral_winds_up(
    bench_logs: MakeLogs, name: str, limit: Mapping[str, float], windup: float
) -> None:
    """The model knows of no limit, and so its fit could not tell."""
    base = replace(MODEL, wheel=replace(MODEL.wheel, law=pi_law(0.1, 0.3, 3.0, 0.3, 0.05)))
    left, values = found(bench_logs, base, name, {**limit, "windup": windup})
    assert left < 1.3
    parameter, size = next(iter(limit.items()))
    assert values[parameter] == pytest.approx(size, rel=0.05)
    assert values.get("windup", 0.0) == pytest.approx(windup, abs=0.05)


def test_a_brake_that_is_the_limit_is_left_out(bench_logs: MakeLogs) -> None:
    left, values = found(bench_logs, MODEL, "acceleration_limit", {"limit_rpm_s": 500.0})
    assert left < 1.3
    assert set(values) == {"limit_rpm_s"}


@pytest.mark.parametrize("droop_n_m", [2.5, 20.0, 60.0])
def test_a_droop_of_five_to_a_hundred_rpm_is_found(bench_logs: MakeLogs, droop_n_m: float) -> None:
    left, values = found(bench_logs, MODEL, "coulomb_friction", {"torque_n_m": droop_n_m})
    assert left < 1.3
    assert values["torque_n_m"] == pytest.approx(droop_n_m, rel=0.03)


def test_the_lag_of_the_answer_to_a_load_is_found(bench_logs: MakeLogs) -> None:
    left, values = found(bench_logs, MODEL, "coulomb_friction", {"torque_n_m": 8.0, "answer_s": 0.06})
    assert left < 1.3
    assert values["answer_s"] == pytest.approx(0.06, rel=0.2)


def test_a_friction_that_warms_up_is_found_where_the_model_has_friction(bench_logs: MakeLogs) -> None:
    hidden = {"share": 0.6, "time_constant_s": 0.8}
    left, values = found(bench_logs, RUBBING, "warm_up/friction", hidden)
    assert left < 1.3
    assert values["share"] == pytest.approx(0.6, rel=0.2)


@pytest.mark.parametrize(
    ("name", "base", "parameter", "size"),
    [
        ("warm_up/cold", MODEL, "share", 0.1),
        ("warm_up/cold", MODEL, "share", -0.1),
        ("warm_up/cold_friction", RUBBING, "torque_n_m", 12.0),
        ("warm_up/cold_friction", MODEL, "torque_n_m", 8.0),
        ("warm_up/cold_friction", MODEL, "damping_n_m_s_rad", 3.0),
    ],
)
def test_a_cold_start_of_a_drive_that_was_fitted_warm_is_one_effect(
    bench_logs: MakeLogs, name: str, base: Model, parameter: str, size: float
) -> None:
    left, values = found(bench_logs, base, name, {parameter: size, "time_constant_s": 0.8})
    assert left < 1.3
    assert values[parameter] == pytest.approx(size, rel=0.2)


def test_a_curve_is_found_as_a_map(bench_logs: MakeLogs) -> None:
    hidden = {"knot_1_rpm": 48.0, "value_1_rpm": 30.0, "knot_2_rpm": 120.0, "value_2_rpm": 120.0}
    left, values = found(bench_logs, MODEL, "static_map", hidden)
    assert left < 2.0
    assert values["value_2_rpm"] == pytest.approx(values["knot_2_rpm"] * 30.0 / 48.0, abs=1.0)
