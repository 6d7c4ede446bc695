"""The blind tests: their simulators are independent, their scores right, and a few cases are solved."""

import ast
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sysid
from mecanum_env.errors import InputError
from sysid.studies.blind.cases import Case, blind_tests, check_case
from sysid.studies.blind.outcome import Outcome, from_json, metrics, to_json
from sysid.studies.blind.work import nominal_model, run_case, saved

TESTS = blind_tests()
MODULES = sorted(Path(TESTS.__file__).parent.glob("*.py"))
CASES = {case.name: case for case in TESTS.cases(0)}
SHARED = {
    "mecanum_env.mjcf",
    "mecanum_env.model",
    "sysid.studies.blind.cases",
    "sysid.logs",
    "sysid.logs.writer",
}
"""The roller model without effects, and the form of the files; nothing of the catalogue or the law."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("blind")


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_the_second_simulators_share_no_code_with_what_they_test(path):
    nodes = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)]
    ours = {
        node.module
        for node in nodes
        if not node.level and node.module.split(".")[0] in ("mecanum_env", "sysid")
    }
    assert ours <= SHARED


def test_there_are_enough_cases_of_each_kind():
    count = {(level, kind): 0 for level in ("bench", "robot") for kind in ("none", "single")}
    for case in CASES.values():
        count[case.level, case.kind] = count.get((case.level, case.kind), 0) + 1
    assert sum(n for (level, _), n in count.items() if level == "bench") >= 200
    assert sum(n for (level, _), n in count.items() if level == "robot") >= 40
    assert count["bench", "none"] >= 40
    assert count["robot", "none"] >= 8


@pytest.mark.parametrize("plant", ["droop", "integral"])
def test_friction_leaves_what_the_physics_of_the_drive_says(plant):
    from blind.bench import RPM, simulate
    from blind.drive import DRIVES, Hidden

    drive = DRIVES[plant]
    _, speed = simulate(drive, Hidden(drag_n_m=0.4), np.full((1, 15), 60.0), np.random.default_rng(0))
    droop = 0.4 / drive.servo / RPM if plant == "droop" else 0.0
    assert np.mean(speed[0, -60:]) == pytest.approx(60.0 - droop, abs=0.2)


def test_logs_are_the_same_whatever_was_made_before(tmp_path):
    name = "bench-single-backlash-clear-1"
    TESTS.write_case(name, 0, tmp_path / "a")
    TESTS.write_case("bench-none-01", 0, tmp_path / "other")
    TESTS.write_case(name, 0, tmp_path / "b")
    for file in (tmp_path / "a").iterdir():
        assert file.read_bytes() == (tmp_path / "b" / file.name).read_bytes()


@pytest.mark.parametrize(
    "name", ["bench-single-speed_saturation-clear-1", "bench-single-sensor_lowpass-clear-1"]
)
def test_a_hidden_effect_is_large_and_our_own_closes_it(folder, name):
    case = CASES[name]
    model = nominal_model(case.plant, folder)
    check = check_case(case, 0, model)
    assert check.before > 3.0
    assert check.after < 1.1


def test_a_nominal_model_predicts_what_is_not_hidden(folder):
    case = CASES["bench-none-01"]
    model = nominal_model(case.plant, folder)
    assert check_case(case, 0, model).before < 1.1


@pytest.mark.parametrize(
    "name",
    [
        "bench-none-02",
        "bench-single-direction_asymmetry-small-1",
        pytest.param("bench-twin-speed_gain-clear-1", marks=pytest.mark.slow),
        pytest.param("bench-pair-speed_saturation-battery_sag-clear-1", marks=pytest.mark.slow),
        pytest.param("bench-outside-warming_up-1", marks=pytest.mark.slow),
        pytest.param("robot-none-01", marks=pytest.mark.slow),
        pytest.param("robot-single-sensor_latency-clear", marks=pytest.mark.slow),
    ],
)
def test_a_few_cases_are_solved(folder, name):
    case = CASES[name]
    run_case(case, 0, folder)
    outcome = from_json(json.loads(saved(case, 0, folder).read_text()))
    if case.truth:
        assert outcome.found
    else:
        assert outcome.verdict == {"none": "no_gap", "outside": "unexplained"}[case.kind]
    assert not (case.kind == "twin" and outcome.verdict == "named")


SINGLE = Case("a", "bench", "single", "clear", "droop", ("backlash",), {"backlash": {"gap_deg": 2.0}})
NAMED = Outcome(
    SINGLE,
    "named",
    ("backlash",),
    (("backlash",),),
    {"backlash": {"gap_deg": (2.1, 1.9, 2.3)}},
    before=6.0,
    after=1.2,
    floor=1.0,
)


def test_what_counts_as_found():
    assert NAMED.found
    assert NAMED.covered() == (True,)
    assert NAMED.closure == pytest.approx(0.96)
    assert not replace(NAMED, named=("backlash", "stiction")).found
    tied = replace(NAMED, verdict="ambiguous", named=("stiction",), candidates=(("stiction",), ("backlash",)))
    assert tied.found
    assert not replace(tied, candidates=(("stiction",),)).found


def test_a_twin_that_is_named_alone_counts_against_it():
    twin = replace(SINGLE, kind="twin", hidden=("sensor_latency",), twins=("command_latency",))
    alone = Outcome(twin, "named", ("sensor_latency",))
    figure = next(m for m in metrics([alone]) if m.name == "twins named alone")
    assert figure.value == 1.0
    assert figure.reached is False


def test_an_outcome_survives_its_file():
    unknown = replace(NAMED, verdict="error", floor=math.nan, message="diverged")
    again = from_json(json.loads(json.dumps(to_json(unknown), allow_nan=False)))
    assert math.isnan(again.floor)
    assert replace(again, floor=0.0) == replace(unknown, floor=0.0)


def test_without_a_checkout_the_message_says_where_to_run(tmp_path, monkeypatch):
    monkeypatch.setattr(sysid, "__file__", str(tmp_path / "sysid" / "__init__.py"))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="checkout"):
        blind_tests()
