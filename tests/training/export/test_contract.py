"""A policy refuses robots that it was not trained for, and says by what they differ."""

from dataclasses import replace

import pytest

from mecanum_env.errors import InputError
from mecanum_env.model import paper_model
from training.controllers.policy import Policy, bundled, load_policy
from training.export import contract_of


@pytest.fixture
def nominal():
    return contract_of(load_policy(bundled("nominal")), "nominal.npz")


def test_the_robot_of_the_training_is_accepted(nominal):
    nominal.refuse(paper_model(), "model.json")


def test_another_command_period_is_refused_by_name(nominal):
    model = paper_model()
    slow = replace(model, wheel=replace(model.wheel, command_period_s=0.2))
    with pytest.raises(
        InputError, match=r"nominal\.npz was not trained for m\.json: command_period_s = 0\.2 s"
    ):
        nominal.refuse(slow, "m.json")


def test_wheels_a_fifth_larger_are_refused(nominal):
    model = paper_model()
    radius = 1.2 * model.robot.wheel_radius_m
    with pytest.raises(InputError, match="top_speed_m_s"):
        nominal.refuse(replace(model, robot=replace(model.robot, wheel_radius_m=radius)), "m.json")


def test_an_effect_needs_compensation_or_a_training_with_such_robots(nominal):
    late = paper_model().with_effect("command_latency", delay_s=0.1)
    with pytest.raises(InputError, match=r"effect command_latency, must be none; add \+compensated"):
        nominal.refuse(late, "m.json")
    nominal.refuse(late, "m.json", compensated=True)
    contract_of(load_policy(bundled("robust")), "robust.npz").refuse(late, "m.json")


def test_a_model_file_of_the_training_that_is_gone_must_be_given():
    about = {"model": {"source": "gone/model.json"}}
    policy = Policy(load_policy(bundled("nominal")).network, about)
    with pytest.raises(
        InputError, match=r"trained on gone/model\.json, which is not there; give it by --model"
    ):
        contract_of(policy, "p.npz")
