"""A cause may take several forms: one effect each, one of them in a model, under one name in its file."""

import json
from dataclasses import replace

import pytest

from mecanum_env.effects import CATALOGUE, registered
from mecanum_env.errors import InputError
from mecanum_env.model import effect_named, form_of, forms_of, model_from_dict, model_to_dict

FIRST = replace(CATALOGUE["acceleration_limit"], name="ramp", first_form="straight")
SECOND = replace(FIRST, name="ramp/bent", first_form="")


@pytest.fixture(autouse=True)
def two_forms():
    with registered(FIRST, after="acceleration_limit"), registered(SECOND, after="ramp"):
        yield


@pytest.mark.parametrize("effect", CATALOGUE.values(), ids=lambda effect: effect.name)
def test_catalogue_and_model_files_call_a_form_the_same(effect):
    assert form_of(effect.name) == effect.form


def test_a_cause_knows_its_forms():
    assert forms_of("ramp") == ("ramp", "ramp/bent")
    assert [form_of(name) for name in forms_of("ramp")] == ["straight", "bent"]
    assert effect_named("ramp") == effect_named("ramp", "straight") == "ramp"
    assert effect_named("ramp", "bent") == "ramp/bent"


@pytest.mark.parametrize(("form", "section"), [(None, {}), ("straight", {}), ("bent", {"form": "bent"})])
def test_a_file_names_the_cause_and_any_form_but_the_first(paper, form, section):
    model = paper.with_effect("ramp", form, limit_rpm_s=300.0)
    value = json.loads(json.dumps(model_to_dict(model)))
    assert value["effects"] == {"ramp": {**section, "limit_rpm_s": 300.0}}
    assert model_from_dict(value) == model


def test_the_first_form_may_be_named_in_a_file(paper):
    value = model_to_dict(paper) | {"effects": {"ramp": {"form": "straight", "limit_rpm_s": 300.0}}}
    assert model_from_dict(value) == paper.with_effect("ramp", limit_rpm_s=300.0)


@pytest.mark.parametrize(
    ("section", "words"),
    [
        ({"form": "cubic"}, "ramp.form = 'cubic': no such form; known: straight, bent"),
        ({"form": 3}, "ramp.form = 3, must be the name of a form"),
    ],
)
def test_an_unknown_form_is_refused_with_the_known_ones(paper, section, words):
    with pytest.raises(InputError, match=words):
        model_from_dict(model_to_dict(paper) | {"effects": {"ramp": section}})


def test_one_form_of_a_cause_replaces_the_other(paper):
    model = paper.with_effect("ramp", limit_rpm_s=300.0).with_effect("ramp", "bent", limit_rpm_s=200.0)
    assert dict(model.effects) == {"ramp/bent": {"limit_rpm_s": 200.0}}
    with pytest.raises(InputError, match="two forms"):
        replace(model, effects={"ramp": {"limit_rpm_s": 1.0}, "ramp/bent": {"limit_rpm_s": 1.0}})
