"""Planar plants written over a compiled one."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from mecanum_env.effects import CATALOGUE
from mecanum_env.tankendo.plant import DrawnRobots, compile_model
from mecanum_env.tankendo.randomize import sampler_for

ROBOT = {
    "robot.mass_kg": (15.0, 25.0),
    "robot.yaw_inertia_kg_m2": (0.8, 1.2),
    "robot.wheel_radius_m": (0.07, 0.08),
    "robot.half_track_m": (0.18, 0.22),
    "robot.half_wheelbase_m": (0.16, 0.2),
    "robot.servo_n_m_s_rad": (3.0, 6.0),
    "robot.torque_limit_n_m": (5.0, 20.0),
    "wheel.saturation_rpm": (100.0, 140.0),
}


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


def drawn_effects(model, rng):
    """Return a model with three effects of those that the planar plant simulates, as they may really be."""
    usual = [
        effect
        for effect in CATALOGUE.values()
        if effect.simulated and effect.realistic and "planar" not in effect.refused_by
    ]
    for effect in rng.choice(usual, 3, replace=False):
        model = model.with_effect(effect.name, **effect.realistic(model))
    return model


@pytest.mark.parametrize("seed", range(24))
def test_a_robot_written_over_another_is_the_compiled_one_to_the_bit(paper, seed):
    rng, drawn, sampler = np.random.default_rng(seed), DrawnRobots(None), sampler_for(ROBOT, paper)
    drawn(sampler.draw(rng))
    model = drawn_effects(sampler.draw(rng), rng)
    robot, fresh = drawn(model), compile_model(model, "planar")
    assert robot.model is model
    assert_same(robot.mj_model, fresh.mj_model)
    np.testing.assert_array_equal(robot.rest, fresh.rest)


def test_robots_that_differ_in_numbers_alone_are_not_compiled(paper, monkeypatch):
    rng, drawn, sampler = np.random.default_rng(0), DrawnRobots(None), sampler_for(ROBOT, paper)
    first = drawn(sampler.draw(rng))
    monkeypatch.setattr(mujoco.MjSpec, "compile", None)
    second = drawn(sampler.draw(rng).with_effect("speed_gain", gain=0.9))
    assert second.mj_model is not first.mj_model
    with pytest.raises(TypeError):
        drawn(sampler.draw(rng).with_effect("payload", mass_kg=5.0))


def test_other_periods_are_compiled_anew(paper):
    drawn = DrawnRobots(None)
    drawn(paper)
    model = replace(paper, wheel=replace(paper.wheel, command_period_s=0.05))
    assert_same(drawn(model).mj_model, compile_model(model, "planar").mj_model)
