"""The "custom" section of a model file: written as it was read, and refused by name."""

import json

import pytest

from mecanum_env.errors import InputError
from mecanum_env.model import (
    CustomEffect,
    CustomTable,
    model_from_dict,
    model_to_dict,
    read_model,
    write_model,
)

FULL = {
    "station": "load",
    "formula": "-0.08 * speed * sin(3 * angle)",
    "unit": "rpm",
    "source": "gap",
    "range": {"speed_rpm": [-120, 120]},
}
TABLE = {"station": "sensor", "table": {"input": "speed", "knots": [-1, 0.1, 3], "values": [0, 1, -2.5]}}


@pytest.fixture
def written(paper):
    """Return a builder of the paper's model as a JSON object with custom effects."""
    return lambda *custom: {**json.loads(json.dumps(model_to_dict(paper))), "custom": list(custom)}


def test_what_is_written_is_read_back_equal(tmp_path, paper, written):
    model = model_from_dict(written(FULL, TABLE))
    assert model.custom == (
        CustomEffect("load", FULL["formula"], source="gap", range={"speed_rpm": (-120.0, 120.0)}),
        CustomEffect("sensor", table=CustomTable("speed", (-1.0, 0.1, 3.0), (0.0, 1.0, -2.5))),
    )
    assert model_to_dict(model)["custom"] == [FULL, {**TABLE, "unit": "rpm"}]
    write_model(model, tmp_path / "model.json")
    assert read_model(tmp_path / "model.json") == model
    assert "custom" not in model_to_dict(paper)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"station": "wheel"}, r"custom\[0\]: station = 'wheel': no such station; known: command, set_point"),
        ({"station": "laod"}, "did you mean .load."),
        ({"formula": "spede"}, r"custom\[0\]: formula = 'spede': unknown name spede"),
        ({"formula": "open(1)"}, "unknown function open"),
        ({"formula": "(" * 20000 + "1" + ")" * 20000}, "too long"),
        ({"formula": "-" * 200 + "1"}, "nested too deep"),
        ({"formula": 3}, r"custom\[0\].formula must be text, not int"),
        ({"table": TABLE["table"]}, "a formula or a table, and not both"),
        ({"unit": "rad/s"}, "unit = 'rad/s', must be 'rpm'"),
        ({"range": {"speed": [0, 1]}}, "range = 'speed'.*speed_rpm"),
        ({"range": {"speed_rpm": [2, 1]}}, "the lower first"),
        ({"range": {"speed_rpm": [2]}}, "must be two numbers"),
        ({"where": "load"}, r"custom\[0\].where: unknown name"),
        ({"station": "sensor", "formula": "command"}, "a sensor does not know command"),
    ],
)
def test_a_wrong_effect_is_refused_in_one_sentence(written, change, message):
    with pytest.raises(InputError, match=message) as caught:
        model_from_dict(written({**FULL, **change}))
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"input": "rpm"}, "table.input = 'rpm'"),
        ({"knots": [0, 0, 1]}, "must increase"),
        ({"knots": [0]}, "1 knots and 3 values, must be 2 to 16"),
        ({"knots": "0 1 2"}, r"custom\[0\].table.knots must be a list of numbers"),
        ({"values": [0, None, 1]}, r"table.values\[1\] = null, must be a number"),
    ],
)
def test_a_wrong_table_is_refused_in_one_sentence(written, change, message):
    with pytest.raises(InputError, match=message):
        model_from_dict(written({**TABLE, "table": {**TABLE["table"], **change}}))


def test_the_section_is_a_list(written):
    with pytest.raises(InputError, match="custom must be a list of objects"):
        model_from_dict({**written(), "custom": FULL})


def test_effects_that_are_too_long_together_are_refused(written):
    with pytest.raises(InputError, match="custom: all effects of the station load together: too long"):
        model_from_dict(written(*[FULL] * 5))
