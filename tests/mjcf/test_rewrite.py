"""Plants written over a compiled one."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from mecanum_env.effects import CATALOGUE
from mecanum_env.tankendo.plant import DrawnRobots, compile_model
from mecanum_env.tankendo.randomize import sampler_for

DIMENSIONS = {
    "robot.wheel_radius_m": (0.07, 0.08),
    "robot.half_track_m": (0.18, 0.22),
    "robot.half_wheelbase_m": (0.16, 0.2),
}
NUMBERS = {
    "robot.mass_kg": (15.0, 25.0),
    "robot.yaw_inertia_kg_m2": (0.8, 1.2),
    "robot.servo_n_m_s_rad": (3.0, 6.0),
    "robot.torque_limit_n_m": (5.0, 20.0),
    "robot.friction": (0.5, 0.9),
    "wheel.saturation_rpm": (100.0, 140.0),
}
ROBOT = {"planar": {**DIMENSIONS, **NUMBERS}, "rollers": NUMBERS}
"""What a plant takes for numbers alone."""


def numbers_of(mj_model):
    """Return every array and number of a compiled model by name."""
    found = {}
    for part, of in (("", mj_model), ("opt.", mj_model.opt), ("stat.", mj_model.stat)):
        names = [name for name in dir(of) if not name.startswith("_")]
        values = {name: getattr(of, name) for name in names}
        found |= {
            part + name: value
            for name, value in values.items()
            if isinstance(value, np.ndarray | float | int)
        }
    return found


def assert_same(mj_model, other):
    ours, theirs = numbers_of(mj_model), numbers_of(other)
    assert ours.keys() == theirs.keys()
    differ = [name for name, value in ours.items() if not np.array_equal(value, theirs[name])]
    assert not differ


def drawn_effects(model, plant, rng):
    """Return a model with three effects of those that the plant simulates, as they may really be."""
    usual = [
        effect
        for effect in CATALOGUE.values()
        if effect.simulated and effect.realistic and plant not in effect.refused_by
    ]
    for effect in rng.choice(usual, 3, replace=False):
        model = model.with_effect(effect.name, **effect.realistic(model))
    return model


@pytest.mark.parametrize("plant", ["planar", "rollers"])
@pytest.mark.parametrize("seed", range(24))
def test_a_robot_written_over_another_is_the_compiled_one_to_the_bit(paper, seed, plant):
    rng, drawn, sampler = (
        np.random.default_rng(seed),
        DrawnRobots(plant, None),
        sampler_for(ROBOT[plant], paper),
    )
    drawn(sampler.draw(rng))
    model = drawn_effects(sampler.draw(rng), plant, rng)
    robot, fresh = drawn(model), compile_model(model, plant)
    assert robot.model is model
    assert_same(robot.mj_model, fresh.mj_model)
    if plant == "planar":
        np.testing.assert_array_equal(robot.rest, fresh.rest)


@pytest.mark.parametrize("plant", ["planar", "rollers"])
def test_what_a_robot_written_over_another_has_in_its_joints_is_written(paper, plant):
    """A load that is answered late is a rotor, which is part of the joint."""
    drawn = DrawnRobots(plant, None)
    drawn(paper)
    model = paper.with_effect("coulomb_friction", torque_n_m=0.1, answer_s=0.02)
    assert_same(drawn(model).mj_model, compile_model(model, plant).mj_model)


@pytest.mark.parametrize("plant", ["planar", "rollers"])
def test_robots_that_differ_in_numbers_alone_are_not_compiled(paper, monkeypatch, plant):
    rng, drawn, sampler = np.random.default_rng(0), DrawnRobots(plant, None), sampler_for(ROBOT[plant], paper)
    first = drawn(sampler.draw(rng))
    monkeypatch.setattr(mujoco.MjSpec, "compile", None)
    second = drawn(sampler.draw(rng).with_effect("speed_gain", gain=0.9))
    assert second.mj_model is not first.mj_model
    with pytest.raises(TypeError):
        drawn(sampler.draw(rng).with_effect("payload", mass_kg=5.0))


@pytest.mark.parametrize("plant", ["planar", "rollers"])
def test_other_periods_are_compiled_anew(paper, plant):
    drawn = DrawnRobots(plant, None)
    drawn(paper)
    model = replace(paper, wheel=replace(paper.wheel, command_period_s=0.05))
    assert_same(drawn(model).mj_model, compile_model(model, plant).mj_model)


@pytest.mark.parametrize("name", DIMENSIONS)
def test_rollers_of_other_dimensions_are_compiled_anew_and_settle(paper, name):
    drawn = DrawnRobots("rollers", None)
    drawn(paper)
    model = sampler_for({name: (DIMENSIONS[name][0],) * 2}, paper).draw(np.random.default_rng(0))
    robot, fresh = drawn(model), compile_model(model, "rollers")
    assert_same(robot.mj_model, fresh.mj_model)
    np.testing.assert_array_equal(robot.rest, fresh.rest)


@pytest.mark.parametrize("seed", range(3))
def test_a_drawn_robot_on_rollers_begins_where_it_would_settle_within_micrometres(paper, seed):
    drawn, sampler = DrawnRobots("rollers", None), sampler_for(NUMBERS, paper)
    first = drawn(paper)
    model = sampler.draw(np.random.default_rng(seed))
    robot = drawn(model)
    np.testing.assert_array_equal(robot.stance, first.stance)
    own = compile_model(model, "rollers").stance
    np.testing.assert_allclose(robot.stance[:3], own[:3], rtol=0.0, atol=1e-6)  # place [m]
    np.testing.assert_allclose(robot.stance[3:8], own[3:8], rtol=0.0, atol=1e-4)  # turn of the base, rocker


@pytest.mark.parametrize("between", ["nothing", "another period", "a payload"])
def test_a_drawn_robot_does_not_depend_on_those_before_it(paper, between):
    others = {
        "another period": replace(paper, wheel=replace(paper.wheel, command_period_s=0.05)),
        "a payload": paper.with_effect("payload", mass_kg=5.0),
    }
    model = replace(paper, robot=replace(paper.robot, mass_kg=23.0))
    drawn, direct = DrawnRobots("rollers", None), DrawnRobots("rollers", None)
    for one in (drawn, direct):
        one(paper)
    if between in others:
        drawn(others[between])
    np.testing.assert_array_equal(drawn(model).rest, direct(model).rest)


@pytest.mark.parametrize("plant", ["planar", "rollers"])
def test_a_model_is_written_over_only_when_its_robot_is_gone(paper, plant):
    drawn = DrawnRobots(plant, None)
    drawn(paper)
    heavy, light = (replace(paper, robot=replace(paper.robot, mass_kg=mass)) for mass in (24.0, 18.0))
    held = drawn(heavy)
    drawn(light.with_effect("speed_gain", gain=0.9).with_effect("backlash", gap_deg=3.0))
    # What the second one was written into is taken for the third, and nothing of it is left.
    third = drawn(light)
    assert len(drawn._template.spares) == 0
    assert_same(held.mj_model, compile_model(heavy, plant).mj_model)
    assert_same(third.mj_model, compile_model(light, plant).mj_model)
