"""Robots that are computed all at once are those that are computed one by one, to the bit."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.batch import Variations, planar_robot
from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.catalogue import registered
from mecanum_env.effects.definition import Effect, Parameter
from mecanum_env.errors import InputError
from mecanum_env.model import ROBOT_NUMBERS, paper_model
from mecanum_env.tankendo.randomize import Sampler, sampler_for

LENGTHS = ("wheel_radius_m", "half_wheelbase_m", "half_track_m")
ROBOT = [name for name in ROBOT_NUMBERS if name not in (*LENGTHS, "rollers_per_wheel")]
ONE_BY_ONE = {  # formulas that take one number: a search, Python's own functions, choices
    *(f"robot.{name}" for name in LENGTHS),
    *("effects.wheel_radius.scale", "effects.track_width.scale", "effects.floor_slope.slope_deg"),
    *("effects.backlash.gap_deg", "effects.backlash/rest.gap_deg", "effects.backlash/spring.gap_deg"),
    *("effects.speed_saturation/supply.limit_rpm", "effects.load_inertia.ratio"),
    "effects.load_inertia/integral.ratio",
    *(f"effects.body_speed_limit.{name}" for name in ("v_rpm", "vc_rpm")),
    *(f"effects.body_acceleration_limit.{name}" for name in ("v_rpm_s", "vc_rpm_s")),
}


def ranges_of_all() -> dict[str, tuple[float, float]]:
    """Return a range for each number that may be drawn, by name."""
    paper, found = paper_model(), {"wheel.saturation_rpm": (100.0, 140.0)}
    for name in (*ROBOT, *LENGTHS):
        value = getattr(paper.robot, name)
        found[f"robot.{name}"] = 0.9 * value, 1.02 * value
    for effect in CATALOGUE.values():
        # The parameters of a map only make sense together.
        if effect.acts_in("planar") and effect.name != "static_map":
            for one in effect.parameters:
                low, high = max(one.bounds[0], one.valid[0]), min(one.bounds[1], one.valid[1])
                found[f"effects.{effect.name}.{one.name}"] = 0.6 * low + 0.4 * high, 0.4 * low + 0.6 * high
    return found


RANGES = ranges_of_all()


def variations(sampler: Sampler) -> Variations:
    rng = np.random.default_rng(0)
    first = np.stack([*(sampler.numbers(rng) for _ in range(3)), *sampler.ends()], axis=-1)
    return Variations(sampler.model, sampler.names, sampler.model_of, first)


def assert_one_by_one(sampler: Sampler, robots: Variations, m: int) -> None:
    """Compare m drawn robots with those that are computed from their models."""
    rng = np.random.default_rng(7)
    values = np.stack([sampler.numbers(rng) for _ in range(m)], axis=-1)
    for one, numbers in zip(robots.robots(values), values.T, strict=True):
        model = sampler.model_of(numbers)
        alone = planar_robot(model)
        np.testing.assert_array_equal(one.drives, alone.drives)
        np.testing.assert_array_equal(one.body, alone.body)
        assert one.model == model
        assert (one.clocks, one.programs, one.link, one.limits) == (
            *(alone.clocks, alone.programs, alone.link, alone.limits),
        )
        assert (one.has_random_link, one.alters_sensors) == (alone.has_random_link, alone.alters_sensors)


@pytest.mark.parametrize("name", RANGES)
def test_every_number_that_may_be_drawn(name):
    sampler = sampler_for({name: RANGES[name]}, paper_model())
    robots = variations(sampler)
    assert robots.at_once == (name not in ONE_BY_ONE)
    assert_one_by_one(sampler, robots, 4)


@pytest.mark.parametrize("m", [1, 2, 9])
def test_the_posterior_with_laws_of_single_wheels(m):
    paper = paper_model()
    law = paper.wheel.law
    known = {
        "wheel": {"covariance": (1e-6 * np.eye(6)).tolist()},
        "robot": {"servo_n_m_s_rad": 0.3, "friction": 0.05},
        "effects": {"coulomb_friction": {"torque_n_m": {"low": 0.05, "high": 0.2}}},
    }
    model = replace(paper, uncertainty=known, wheels={"fl": replace(law, A=law.A - 0.01)})
    sampler = sampler_for("posterior", model)
    robots = variations(sampler)
    assert robots.at_once
    assert_one_by_one(sampler, robots, m)


def test_many_numbers_together():
    names = [f"robot.{name}" for name in ROBOT]
    names += ["wheel.saturation_rpm", "effects.speed_gain.gain", "effects.wheel_gain_mismatch.gain_rl"]
    names += ["effects.command_loss.share", "effects.payload.mass_kg", "effects.com_offset.x_m"]
    names += ["effects.viscous_friction.damping_n_m_s_rad", "effects.sensor_scale.yaw"]
    sampler = sampler_for({name: RANGES[name] for name in names}, paper_model())
    robots = variations(sampler)
    assert robots.at_once
    assert_one_by_one(sampler, robots, 6)


def test_a_robot_that_cannot_be_is_refused_by_its_own_number():
    paper = paper_model()
    sampler = sampler_for({"robot.mass_kg": (18.0, 24.0), "robot.yaw_inertia_kg_m2": (0.3, 0.9)}, paper)
    robots = Variations(paper, sampler.names, sampler.model_of, np.array([[18.0, 24.0], [0.9, 0.9]]))
    assert robots.at_once
    with pytest.raises(InputError, match=r"yaw_inertia_kg_m2 = 0\.01 is less than the wheels"):
        robots.robots(np.array([[20.0, 20.0], [0.9, 0.01]]))


def test_a_formula_that_gives_others_for_arrays_is_not_used_with_them():
    def change(drive, values, _):
        return replace(drive, gain=values["gain"] + (0.0 if isinstance(values["gain"], float) else 1e-12))

    effect = Effect(
        name="fussy_gain",
        station="set_point",
        acts_on="drive",
        parameters=(Parameter("gain", "1", 1.0, (0.5, 1.5)),),
        summary="s",
        signature="s",
        change_drive=change,
    )
    with registered(effect):
        sampler = sampler_for({"effects.fussy_gain.gain": (0.8, 0.9)}, paper_model())
        robots = variations(sampler)
        assert not robots.at_once
        assert_one_by_one(sampler, robots, 3)


def test_they_can_be_copied():
    sampler = sampler_for({"robot.mass_kg": (18.0, 24.0)}, paper_model())
    assert_one_by_one(sampler, copy.deepcopy(variations(sampler)), 3)
