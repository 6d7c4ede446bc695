"""model.json: what is written is read back equal; what is wrong is refused by name."""

import json
import math
import os
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.errors import InputError, UnstableLawError
from mecanum_env.files import asset_path
from mecanum_env.kinematics import WHEELS
from mecanum_env.law import WheelLaw
from mecanum_env.mjcf.masses import robot_masses
from mecanum_env.model import (
    EFFECT_PARAMETERS,
    Model,
    Robot,
    Wheel,
    cause_of,
    model_from_dict,
    model_to_dict,
    paper_model,
    read_model,
    robot_from_dict,
    write_model,
)

POSITIVE = st.floats(1e-6, 1e6)
JSON = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(max_size=5), inner, max_size=2),
    max_leaves=4,
)
ABSENT = object()


@st.composite
def stable_laws(draw, period):
    poles = [draw(st.floats(-0.99, 0.99)) for _ in range(3)]
    a, b, c = -np.poly(poles)[1:]
    law = WheelLaw(float(a), float(b), float(c), *(draw(st.floats(-2.0, 2.0)) for _ in range(3)), period)
    return law if law.is_stable else WheelLaw(0.5, 0.0, 0.0, 0.5, 0.0, 0.0, period)


@st.composite
def models(draw):
    period = draw(st.floats(1e-4, 1.0))
    wheel = Wheel(
        draw(stable_laws(period)),
        draw(st.floats(1e-3, 1.0)),
        draw(st.floats(0.0, 5.0)),
        draw(POSITIVE | st.just(math.inf)),
    )
    robot = Robot(
        *(draw(POSITIVE) for _ in range(5)),
        draw(st.integers(4, 24)),
        draw(POSITIVE),
        draw(st.floats(0.0, 100.0)),
        draw(st.floats(0.0, 1.0)),
        draw(POSITIVE),
        draw(POSITIVE),
    )
    names = draw(st.lists(st.sampled_from(sorted(EFFECT_PARAMETERS)), max_size=3, unique_by=cause_of))
    value = st.floats(-1e3, 1e3) | st.just(math.inf)
    effects = {name: {key: draw(value) for key in EFFECT_PARAMETERS[name]} for name in names}
    sections = st.dictionaries(st.text(max_size=5), JSON, max_size=2)
    extra = {"comment": draw(JSON)} if draw(st.booleans()) else {}
    for section in ("wheel", "robot"):
        if draw(st.booleans()):
            extra[section] = {"#note": draw(JSON)}
    wheels = {name: draw(stable_laws(period)) for name in draw(st.sets(st.sampled_from(WHEELS)))}
    return Model(wheel, robot, effects, draw(sections), draw(sections), extra, wheels)


@pytest.fixture
def written(paper):
    """Return the paper's model as the JSON object of its file."""
    return json.loads(json.dumps(model_to_dict(paper)))


@given(models())
def test_what_is_written_is_read_back_equal(tmp_path_factory, model):
    path = tmp_path_factory.getbasetemp() / "model.json"
    write_model(model, path)
    assert read_model(path) == model


def test_an_absent_limit_is_null_in_the_file(paper):
    model = replace(paper, wheel=replace(paper.wheel, saturation_rpm=math.inf))
    model = model.with_effect("acceleration_limit", limit_rpm_s=math.inf)
    value = model_to_dict(model)
    assert value["wheel"]["saturation_rpm"] is None
    assert value["effects"] == {"acceleration_limit": {"limit_rpm_s": None}}
    assert model_from_dict(value) == model


def test_the_packaged_model_is_written_by_this_code(paper):
    assert json.loads(asset_path("models/paper.json").read_text()) == model_to_dict(paper)
    assert "inferred" in paper.provenance["sample_period_s"]
    assert paper_model() == paper


def test_robot_may_be_absent_or_partial(written):
    del written["robot"]
    assert model_from_dict(written).robot == Robot()
    written["robot"] = {"mass_kg": 7.5, "rollers_per_wheel": 9.0}
    robot = model_from_dict(written).robot
    assert robot == replace(Robot(), mass_kg=7.5, rollers_per_wheel=9)
    assert isinstance(robot.rollers_per_wheel, int)


def test_a_robot_of_another_size_has_the_yaw_inertia_of_a_plate_until_it_is_known():
    size = {"wheel_radius_m": 0.165, "half_wheelbase_m": 0.256, "half_track_m": 0.2775, "mass_kg": 50.0}
    robot = robot_from_dict(size)
    assert robot.yaw_inertia_kg_m2 == pytest.approx(2.376, abs=5e-4)
    robot_masses(robot)  # the packaged 0.9 is less than such wheels alone have, and was refused
    assert robot_from_dict({**size, "yaw_inertia_kg_m2": 3.0}).yaw_inertia_kg_m2 == 3.0
    for missing in ("half_wheelbase_m", "half_track_m", "mass_kg"):
        partial = {name: value for name, value in size.items() if name != missing}
        assert robot_from_dict(partial).yaw_inertia_kg_m2 == Robot().yaw_inertia_kg_m2


def test_a_heavier_robot_can_accelerate_as_hard_as_the_packaged_one_until_its_torque_is_known():
    size = {"wheel_radius_m": 0.165, "mass_kg": 50.0}
    packaged = Robot()
    force = packaged.torque_limit_n_m / packaged.wheel_radius_m / packaged.mass_kg
    robot = robot_from_dict(size)
    assert robot.torque_limit_n_m / robot.wheel_radius_m / robot.mass_kg == pytest.approx(force)
    assert robot_from_dict({**size, "torque_limit_n_m": 2.0}).torque_limit_n_m == 2.0
    for small in ({"mass_kg": 50.0}, {"wheel_radius_m": 0.05, "mass_kg": 5.0}):
        assert robot_from_dict(small).torque_limit_n_m == packaged.torque_limit_n_m


def test_a_robot_of_another_size_lags_behind_its_servo_as_the_packaged_one_until_that_is_known():
    size = {"wheel_radius_m": 0.03, "mass_kg": 1.3}

    def lag_s(robot: Robot) -> float:
        return robot.mass_kg * robot.wheel_radius_m**2 / (4.0 * robot.servo_n_m_s_rad)

    assert lag_s(robot_from_dict(size)) == pytest.approx(lag_s(Robot()))
    assert robot_from_dict({**size, "servo_n_m_s_rad": 2.0}).servo_n_m_s_rad == 2.0
    for missing in size:
        partial = {name: value for name, value in size.items() if name != missing}
        assert robot_from_dict(partial).servo_n_m_s_rad == Robot().servo_n_m_s_rad


def test_the_smallest_file_is_a_law(paper):
    law = paper.wheel.law
    numbers = {**dict(zip("ABCDEF", law.coefficients, strict=True)), "sample_period_s": law.sample_period_s}
    assert model_from_dict({"format": "mecanum-model/1", "wheel": numbers}) == Model(Wheel(law))


def test_fields_of_other_programs_are_kept(written, tmp_path):
    written["colour"] = "red"
    written["wheel"]["#serial"] = [1, 2]
    written["robot"]["notes"] = {"floor": "carpet"}
    model = model_from_dict(written)
    assert model.extra == {
        "colour": "red",
        "wheel": {"#serial": [1, 2]},
        "robot": {"notes": {"floor": "carpet"}},
    }
    write_model(model, tmp_path / "model.json")
    assert json.loads((tmp_path / "model.json").read_text()) == written


BAD_VALUES = [
    ("wheel.A", math.inf, "A = inf, must be a finite number"),
    ("wheel.A", None, "wheel.A = null, must be a number"),
    ("wheel.A", "0.9", 'wheel.A = "0.9", must be a number'),
    ("wheel.A", True, "wheel.A = true, must be a number"),
    ("wheel.A", 10**400, "wheel.A is beyond double precision"),
    ("wheel.C", ABSENT, '"wheel" lacks C'),
    ("wheel.sample_period_s", 0, "sample_period_s = 0.0, must be above 0"),
    ("wheel.sample_perod_s", 1, 'wheel.sample_perod_s: unknown name (did you mean "sample_period_s"?)'),
    ("wheel.command_period_s", 0, "wheel.command_period_s = 0.0, must be a finite number above 0"),
    ("wheel.command_period_s", None, "wheel.command_period_s = null, must be a number"),
    ("wheel.command_quantum_rpm", -1, "wheel.command_quantum_rpm = -1.0, must be a finite number at least 0"),
    ("wheel.saturation_rpm", 0, "wheel.saturation_rpm = 0.0, must be a number above 0"),
    ("wheel.windup", -0.5, "wheel.windup = -0.5, must be a number from 0 to 1"),
    ("wheel", [], "wheel must be a JSON object, not list"),
    ("wheel", ABSENT, '"wheel" is missing'),
    ("format", "mecanum-model/2", '"format" is \'mecanum-model/2\', must be "mecanum-model/1"'),
    ("format", ABSENT, '"format" is None, must be'),
    ("robot.mass_kg", -1, "robot.mass_kg = -1.0, must be a finite number above 0"),
    ("robot.mass_kg", None, "robot.mass_kg = null, must be a number"),
    ("robot.wheel_radius", 0.05, 'robot.wheel_radius: unknown name (did you mean "wheel_radius_m"?)'),
    ("robot.yaw_inertia_kg_m2", 0, "robot.yaw_inertia_kg_m2 = 0.0, must be a finite number above 0"),
    ("robot.servo_integral_n_m_rad", -1, "robot.servo_integral_n_m_rad = -1.0, must be a finite number at"),
    ("robot.servo_windup", 1.5, "robot.servo_windup = 1.5, must be a number from 0 to 1"),
    ("robot.friction", 0, "robot.friction = 0.0, must be a finite number above 0"),
    ("robot.rollers_per_wheel", 10.5, "robot.rollers_per_wheel = 10.5, must be a whole number 4..24"),
    ("robot.rollers_per_wheel", 3, "robot.rollers_per_wheel = 3, must be a whole number 4..24"),
    ("robot.rollers_per_wheel", math.inf, "robot.rollers_per_wheel = inf, must be a whole number 4..24"),
    ("robot.rollers_per_wheel", None, "robot.rollers_per_wheel = null, must be a number"),
    (
        "effects.backlsh",
        {"gap_deg": 1},
        'effects.backlsh: no such effect (did you mean "backlash"?); known: comm',
    ),
    ("effects.backlash", {"gap": 1}, 'effects.backlash.gap: unknown name (did you mean "gap_deg"?)'),
    ("effects.backlash", {"gap_deg": "big"}, 'effects.backlash.gap_deg = "big", must be a number'),
    ("effects.backlash", 2.1, "effects.backlash must be a JSON object, not float"),
    ("effects", [], "effects must be a JSON object, not list"),
    ("wheels.front", {}, '"wheels.front" lacks A, B, C, D, E, F'),
    ("wheels.fl", {"A": 0.5}, '"wheels.fl" lacks B, C, D, E, F'),
    ("wheels.fl", {"sample_period_s": 0.1}, "wheels.fl.sample_period_s: unknown name"),
    ("wheels.front", dict.fromkeys("ABCDEF", 0.1), "wheels.front: no such wheel; known: fl, fr, rl, rr"),
    ("uncertainty", 1, "uncertainty must be a JSON object, not int"),
    ("uncertainty.wheel", 5, "uncertainty.wheel must be a JSON object, not int"),
    (
        "uncertainty.wheel",
        {"names": 5},
        'uncertainty.wheel.names = 5, must be ["A", "B", "C", "D", "E", "F"]',
    ),
    (
        "uncertainty.wheel",
        {"covariance": [[1, 2], [3, 4]]},
        "uncertainty.wheel.covariance must be 6 rows of 6 numbers, for A, B, C, D, E, F; make one with",
    ),
    ("uncertainty.wheel", {"covariance": 1}, "uncertainty.wheel.covariance must be 6 rows of 6 numbers"),
    (
        "uncertainty.wheel",
        {"covariance": [[1] * 6] * 5 + [[1] * 5 + ["a"]]},
        'uncertainty.wheel.covariance[5][5] = "a", must be a number',
    ),
    ("uncertainty.robot", {"bogus": 1}, "uncertainty.robot.bogus: unknown name; known: wheel_radius_m"),
    ("uncertainty.robot", {"mass_kg": None}, "uncertainty.robot.mass_kg = null, must be a number"),
    ("uncertainty.robot", {"mass_kg": -1}, "uncertainty.robot.mass_kg = -1, must not be negative"),
    (
        "uncertainty.effects",
        {"backlsh": {}},
        'uncertainty.effects.backlsh: unknown name (did you mean "backl',
    ),
    ("uncertainty.effects", {"backlash": {"gap": {}}}, "uncertainty.effects.backlash.gap: unknown name"),
    (
        "uncertainty.effects",
        {"backlash": {"gap_deg": {"low": "a", "high": 2}}},
        'uncertainty.effects.backlash.gap_deg.low = "a", must be a number',
    ),
    (
        "uncertainty.effects",
        {"backlash": {"gap_deg": {"low": 1}}},
        "uncertainty.effects.backlash.gap_deg.high = null, must be a number",
    ),
    (
        "uncertainty.effects",
        {"backlash": {"gap_deg": {"low": 2, "high": 1}}},
        "uncertainty.effects.backlash.gap_deg.low = 2, must be at most high = 1",
    ),
    ("uncertainty.model_error", 1, "uncertainty.model_error must be a JSON object, not int"),
    (
        "uncertainty.commands_between_rows",
        {"late_s": -1.0},
        "uncertainty.commands_between_rows.late_s = -1",
    ),
    ("uncertainty.model_error", {}, "uncertainty.model_error.channels must be a JSON object, not NoneType"),
    (
        "uncertainty.model_error",
        {"channels": {"speed_rpm": {"settled": 1, "transient": math.inf, "correlation_s": 0.1}}},
        "uncertainty.model_error.channels.speed_rpm.transient = inf, must be a finite number",
    ),
    ("provenance", "me", "provenance must be a JSON object, not str"),
]


@pytest.mark.parametrize(("where", "bad", "message"), BAD_VALUES)
def test_a_bad_value_is_refused_by_name(written, where, bad, message):
    *sections, name = where.split(".")
    target = written
    for section in sections:
        target = target.setdefault(section, {})
    if bad is ABSENT:
        del target[name]
    else:
        target[name] = bad
    with pytest.raises(InputError) as raised:
        model_from_dict(written)
    assert message in str(raised.value)


def test_fields_of_other_programs_within_the_uncertainty_are_kept(written):
    written["uncertainty"] = {
        "wheel": {"covariance": None, "degrees_of_freedom": 4.0, "#note": 1},
        "effects": {"backlash": {"gap_deg": {"value": 1.5, "low": 1, "high": 2, "#note": None}}},
        "model_error": {"channels": {}, "#note": []},
        "#note": "mine",
    }
    assert model_from_dict(written).uncertainty == written["uncertainty"]


@pytest.mark.parametrize("where", ["wheel", "wheels.rr"])
def test_an_unstable_law_is_refused_with_its_poles(written, where):
    bad = {"A": 1.5, "B": 0.0, "C": 0.0, "D": -0.5, "E": 0.0, "F": 0.0}
    if where == "wheel":
        written["wheel"].update(bad)
    else:
        written["wheels"] = {"rr": bad}
    with pytest.raises(UnstableLawError, match=rf'"{where}": .*poles 1\.5\+0j \(\|z\| 1\.5\)'):
        model_from_dict(written)


def test_an_unstable_model_is_not_written(paper, tmp_path):
    bad = replace(paper.wheel.law, A=1.5)
    with pytest.raises(UnstableLawError):
        write_model(replace(paper, wheel=replace(paper.wheel, law=bad)), tmp_path / "model.json")
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"format": \n oops}', "model.json, line 2: not valid JSON"),
        ('{"uncertainty": NaN}', "model.json: NaN is not valid JSON; an absent limit is null"),
        ("[]", "model.json: the file must be a JSON object, not list"),
        ("", "model.json, line 1: not valid JSON"),
    ],
)
def test_a_file_that_is_not_a_model_is_named(tmp_path, text, message):
    path = tmp_path / "model.json"
    path.write_text(text)
    with pytest.raises(InputError) as raised:
        read_model(path)
    assert str(raised.value).startswith(str(tmp_path))
    assert message in str(raised.value)


def test_a_binary_or_missing_file_is_named(tmp_path):
    (tmp_path / "film.mp4").write_bytes(b"\xff\xfe\x80")
    with pytest.raises(InputError, match=r"film\.mp4: not a text file"):
        read_model(tmp_path / "film.mp4")
    with pytest.raises(InputError, match=r"none\.json: cannot be read .*python -m sysid\.fit LOGS"):
        read_model(tmp_path / "none.json")


def test_a_failing_write_leaves_the_old_file(paper, tmp_path):
    path = tmp_path / "model.json"
    write_model(paper, path)
    before = path.read_bytes()
    with pytest.raises(InputError, match="not written"):
        write_model(replace(paper, uncertainty={"A": math.nan}), path)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["model.json"]


def test_an_effect_is_added_to_a_copy(paper):
    model = paper.with_effect("backlash", gap_deg=2.1)
    assert model.effects == {"backlash": {"gap_deg": 2.1}}
    assert paper.effects == {}
    assert model.with_effect("backlash", gap_deg=3.0).effects == {"backlash": {"gap_deg": 3.0}}


@pytest.mark.parametrize("bad", [math.nan, -math.inf])
def test_an_effect_is_a_number(paper, bad):
    with pytest.raises(InputError, match=rf"effects\.backlash\.gap_deg = {bad}, must be a number"):
        paper.with_effect("backlash", gap_deg=bad)


def test_each_wheel_may_have_its_own_law(paper):
    own = WheelLaw(0.9, 0.0, 0.0, 0.1, 0.0, 0.0, paper.wheel.law.sample_period_s)
    model = replace(paper, wheels={"rl": own})
    assert model.law_of("rl") == own
    assert [model.law_of(name) for name in ("fl", "fr", "rr")] == [paper.wheel.law] * 3
    with pytest.raises(InputError, match="front: no such wheel; known: fl, fr, rl, rr"):
        model.law_of("front")


def test_wheels_tick_together(paper):
    with pytest.raises(
        InputError, match=r"wheels\.rl: sample_period_s = 0\.01, must be that of the common law"
    ):
        replace(paper, wheels={"rl": WheelLaw(0.9, 0.0, 0.0, 0.1, 0.0, 0.0, 0.01)})


def test_a_measured_robot_file_is_strict():
    assert robot_from_dict({"mass_kg": 3}).mass_kg == 3.0
    with pytest.raises(InputError, match=r"robot\.colour: unknown name; known: wheel_radius_m"):
        robot_from_dict({"colour": "red"})


def test_the_folder_of_a_fit_is_refused_with_the_file_in_it(tmp_path):
    write_model(paper_model(), tmp_path / "model.json")
    with pytest.raises(InputError, match=r"is a folder, must be a file; did you mean .*model\.json\?"):
        read_model(tmp_path)


def test_a_model_of_another_version_is_refused_with_what_to_do(tmp_path):
    (tmp_path / "old.json").write_text('{"format": "mecanum-model/0"}')
    with pytest.raises(InputError, match=r"old\.json: .* `python -m sysid\.fit LOGS` writes: fit again"):
        read_model(tmp_path / "old.json")
