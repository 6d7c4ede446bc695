"""The list of omni wheels in robot.json and model.json."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from mecanum_env.errors import InputError
from mecanum_env.mjcf import planar_spec
from mecanum_env.model import model_from_dict, model_to_dict, paper_model, read_robot, robot_from_dict
from mecanum_env.omni import OmniWheel

WHEELS = [{"angle_deg": 120.0 * i, "distance_m": 0.135, "radius_m": 0.04} for i in range(3)]


def test_wheels_are_read_named_by_their_place_and_give_the_radius(tmp_path: Path) -> None:
    (tmp_path / "robot.json").write_text(json.dumps({"wheels": WHEELS, "mass_kg": 11.0}))
    robot = read_robot(tmp_path / "robot.json")
    assert robot.wheels[1] == OmniWheel("2", 120.0, 0.135, 0.04)
    assert (robot.wheel_radius_m, robot.mass_kg) == (0.04, 11.0)


def test_a_model_with_wheels_survives_its_file() -> None:
    wheels = (
        *robot_from_dict({"wheels": WHEELS}).wheels[:2],
        OmniWheel("back", 240.0, 0.1, 0.04, 10.0, 45.0),
    )
    model = replace(paper_model(), robot=replace(paper_model().robot, wheels=wheels))
    assert model_from_dict(json.loads(json.dumps(model_to_dict(model)))) == model


def test_a_model_without_wheels_is_written_as_before() -> None:
    assert "wheels" not in model_to_dict(paper_model())["robot"]


@pytest.mark.parametrize(
    ("wheels", "message"),
    [
        ([], "robot.wheels must be a list of wheels"),
        ([{"angle_deg": 0.0}], r"robot.wheels\[0\] lacks distance_m, radius_m"),
        ([{**WHEELS[0], "radius": 1}], r'radius: unknown name \(did you mean "radius_m"\?\)'),
        ([{**WHEELS[0], "radius_m": 0}], "radius_m = 0.0, must be above 0"),
        ([{**WHEELS[0], "name": "a b"}], "name = 'a b', must be letters, digits and underscores"),
        ([{**WHEELS[0], "roller_deg": 90}], "roller_deg = 90.0, must be within -85 .. 85"),
        (WHEELS[:2], "cannot drive the body forward, sideways and turning at will"),
    ],
)
def test_impossible_wheels_are_refused(wheels: list[dict[str, object]], message: str) -> None:
    with pytest.raises(InputError, match=message):
        robot_from_dict({"wheels": wheels})


def test_the_plants_refuse_other_wheels() -> None:
    model = replace(paper_model(), robot=robot_from_dict({"wheels": WHEELS}))
    with pytest.raises(InputError, match="lists 3 wheels, but the plant planar is of four Mecanum wheels"):
        planar_spec(model)
