"""Robots as arrays move as MuJoCo's planar plant does, with every effect that acts there."""

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.batch import PlanarBatch, planar_robot
from mecanum_env.effects.catalogue import registered
from mecanum_env.effects.definition import Effect, Parameter
from mecanum_env.errors import EffectRefusedError, InputError
from mecanum_env.model import paper_model
from mecanum_env.model.custom import CustomEffect
from mecanum_env.model.static_map import map_parameters
from mecanum_env.simulator import SimulationDivergedError
from tests.batch.conftest import ACTING
from tests.effects.conftest import clear_model

CLOSE = 1e-6


def test_the_plain_robot(apart):
    assert apart(paper_model()) < CLOSE


@pytest.mark.parametrize(("name", "parameter"), ACTING)
def test_every_effect_by_each_of_its_parameters(apart, name, parameter):
    assert apart(clear_model(name, parameter)) < CLOSE


@pytest.mark.parametrize(
    "effects",
    [
        {"command_latency/jitter": {"delay_s": 0.13, "jitter_s": 0.04}, "command_loss": {"share": 0.3}},
        {"command_latency": {"delay_s": 0.07}, "acceleration_limit": {"limit_rpm_s": 300.0}},
        {
            "payload": {"mass_kg": 8.0},
            "com_offset": {"x_m": 0.05, "y_m": -0.03},
            "floor_slope": {"slope_deg": 4.0},
        },
        {"body_acceleration_limit": {"v_rpm_s": 300.0}, "command_latency": {"delay_s": 0.03}},
        {"static_map": map_parameters([-50.0, 0.0, 20.0, 90.0], [-40.0, 0.0, 9.0, 95.0])},
        {"backlash": {"gap_deg": 4.0}, "stiction/washed_out": {"breakaway_n_m": 0.3}},
        {"backlash/spring": {"gap_deg": 8.0}, "coulomb_friction": {"torque_n_m": 0.1}},
    ],
)
def test_effects_together(apart, effects):
    assert apart(replace(paper_model(), effects=effects)) < CLOSE


@pytest.mark.parametrize("device", [None, "cpu"])
@pytest.mark.parametrize("windup", [0.0, 0.4, 1.0])
def test_an_integral_that_winds_up_at_the_torque_limit(apart, windup, device):
    if device is not None:
        pytest.importorskip("torch", reason="torch is not installed")
    servo = {"servo_n_m_s_rad": 1.0, "servo_integral_n_m_rad": 3.0, "torque_limit_n_m": 0.4}
    robot = replace(paper_model().robot, servo_windup=windup, **servo)
    assert apart(replace(paper_model(), robot=robot), device=device) < CLOSE


@pytest.mark.parametrize("device", [None, "cpu"])
@pytest.mark.parametrize("windup", [0.4, 1.0])
def test_a_law_that_winds_up_at_the_motor_s_bounds(apart, windup, device):
    if device is not None:
        pytest.importorskip("torch", reason="torch is not installed")
    model = paper_model().with_effect("acceleration_limit/drive", limit_rpm_s=300.0)
    model = model.with_effect("speed_saturation/supply", limit_rpm=90.0)
    assert apart(replace(model, wheel=replace(model.wheel, windup=windup)), device=device) < CLOSE


def test_each_robot_has_its_own_numbers(apart):
    def robot(gain, mass, delay, acceleration):
        model = (
            paper_model().with_effect("speed_gain", gain=gain).with_effect("command_latency", delay_s=delay)
        )
        model = model.with_effect("acceleration_limit/drive", limit_rpm_s=acceleration)
        return replace(model, robot=replace(model.robot, mass_kg=mass))

    models = robot(0.9, 20.0, 0.05, 900.0), robot(0.8, 24.0, 0.12, 400.0), robot(1.1, 18.0, 0.02, 700.0)
    assert apart(*models) < CLOSE


def test_a_robot_whose_mass_is_off_the_middle_beside_one_in_which_it_is_not():
    plain, shifted = (
        planar_robot(one) for one in (paper_model(), paper_model().with_effect("com_offset", x_m=0.05))
    )
    both, alone = PlanarBatch(plain, 2), PlanarBatch(shifted, 1)
    both.restart(1, (0.0, 0.0, 0.3), shifted)
    alone.restart(0, (0.0, 0.0, 0.3))
    for _ in range(10):
        both.step(np.tile([60.0, 40.0, 20.0], (2, 1)))
        alone.step(np.array([[60.0, 40.0, 20.0]]))
    np.testing.assert_allclose(both.motion()[:, 1], alone.motion()[:, 0], atol=1e-12)


@pytest.mark.parametrize("station", ["command", "set_point", "load"])
def test_custom_effects(apart, station):
    formula = CustomEffect(station, formula="-0.08 * speed * abs(sin(3 * angle))", unit="rpm")
    assert apart(replace(paper_model(), custom=(formula,))) < CLOSE


@pytest.mark.parametrize("timestep_s", [1 / 240, 1 / 480])
def test_a_finer_physics_step(apart, timestep_s):
    model = paper_model().with_effect("command_latency", delay_s=0.05)
    assert apart(model, timestep_s=timestep_s) < CLOSE


@pytest.mark.parametrize("sample_period_s", [0.008, 0.0083, 0.01])
def test_clocks_that_do_not_fit_into_each_other(apart, sample_period_s):
    model = paper_model().with_effect("command_latency", delay_s=0.05)
    law = replace(model.wheel.law, sample_period_s=sample_period_s)
    assert apart(replace(model, wheel=replace(model.wheel, law=law))) < CLOSE


def test_torch_computes_the_same(apart):
    pytest.importorskip("torch", reason="torch is not installed")
    effects = {
        "command_latency": {"delay_s": 0.07},
        "stiction": {"breakaway_n_m": 0.3},
        "backlash": {"gap_deg": 2.0},
    }
    assert apart(replace(paper_model(), effects=effects), device="cpu") < CLOSE


def test_a_new_effect_on_the_body_is_refused_until_it_has_a_form_for_batches():
    effect = Effect(
        name="carpet",
        station="body",
        acts_on="body",
        parameters=(Parameter("damping", "N s/m", 0.0, (0.0, 10.0)),),
        summary="s",
        signature="s",
        change_spec=lambda spec, values, model, plant: None,
    )
    with (
        registered(effect),
        pytest.raises(EffectRefusedError, match=r"effects\.carpet: has no form for batches"),
    ):
        planar_robot(paper_model().with_effect("carpet", damping=1.0))


def test_effects_that_the_planar_plant_refuses_are_refused():
    with pytest.raises(EffectRefusedError, match=r"effects\.low_grip"):
        planar_robot(paper_model().with_effect("low_grip", friction=0.1))


def test_robots_that_do_not_go_together_are_refused():
    robots = PlanarBatch(planar_robot(paper_model()), 2)
    with pytest.raises(InputError, match="robots of one batch must have the same"):
        robots.restart(1, (0, 0, 0), planar_robot(paper_model().with_effect("body_speed_limit", v_rpm=50.0)))


def test_the_robot_that_diverged_is_named():
    robots = PlanarBatch(planar_robot(paper_model()), 3)
    robots._velocity[0, 2] = np.nan
    with pytest.raises(SimulationDivergedError, match="robot 2 diverged"):
        robots.step(np.zeros((3, 3)))
