"""The planar plant without MuJoCo moves as MuJoCo's does, with every effect that acts there."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from mecanum_env.batch.runs import PlanarDrives
from mecanum_env.effects import CATALOGUE
from mecanum_env.errors import InputError
from mecanum_env.model import Model, paper_model
from mecanum_env.model.custom import CustomEffect
from mecanum_env.simulator import BodyCommands, SimulationDivergedError, drive
from mecanum_env.simulator.supply import Supply
from tests.batch.conftest import ACTING
from tests.effects.conftest import clear_model

STEP_S = 1 / 240
CLOSE = 1e-9
RNG = np.random.default_rng(5)
COMMANDS = BodyCommands(
    np.arange(10) * 0.4, *np.round(RNG.uniform([-90, -180, -60], [90, 180, 60], (10, 3))).T
)


def apart(model: Model, supply: Supply | None = None) -> float:
    """Return the largest difference of a channel from that of MuJoCo's planar plant."""
    there = drive(model, COMMANDS, 4.0, plant="planar", timestep_s=STEP_S, supply=supply)
    here = PlanarDrives(model, STEP_S).drive(COMMANDS, 4.0, supply)
    np.testing.assert_array_equal(here.time_s, there.time_s)
    pairs = ((here.wheels_rpm, there.wheels_rpm), (here.twist, there.twist), (here.pose, there.pose))
    return max(float(np.max(np.abs(one - other))) for one, other in pairs)


def test_the_plain_robot():
    assert apart(paper_model()) < CLOSE


@pytest.mark.parametrize(("name", "parameter"), ACTING)
def test_every_effect_by_each_of_its_parameters(name, parameter):
    assert apart(clear_model(name, parameter)) < CLOSE


@pytest.mark.parametrize(
    "effects",
    [
        {"command_latency/jitter": {"delay_s": 0.13, "jitter_s": 0.04}, "command_loss": {"share": 0.3}},
        {
            "payload": {"mass_kg": 8.0},
            "com_offset": {"x_m": 0.05, "y_m": -0.03},
            "floor_slope": {"slope_deg": 4.0},
        },
        {"body_acceleration_limit": {"v_rpm_s": 300.0}, "command_latency": {"delay_s": 0.03}},
        {"backlash": {"gap_deg": 4.0}, "stiction/washed_out": {"breakaway_n_m": 0.3}},
    ],
)
def test_effects_together(effects):
    assert apart(replace(paper_model(), effects=effects)) < CLOSE


def test_wheels_that_differ():
    law = paper_model().wheel.law
    slower = replace(law, D=0.9 * law.D, E=0.9 * law.E, F=0.9 * law.F)
    assert apart(replace(paper_model(), wheels={"fl": slower})) < CLOSE


def test_a_custom_effect():
    custom = (CustomEffect("command", "-5 * sign(command)"), CustomEffect("load", "-3 * sign(speed)"))
    assert apart(replace(paper_model(), custom=custom)) < CLOSE


def test_a_supply_that_sinks():
    supply = Supply(np.array([0.0, 0.5, 2.0]), np.array([24.0, 24.0, 20.0]), 24.0)
    model = paper_model().with_effect("battery_sag", drop_per_s=0.05, per_volt=0.05)
    assert apart(model) < CLOSE
    assert apart(model, supply) < CLOSE


def test_a_robot_that_diverges_is_an_error():
    pushed = replace(paper_model(), custom=(CustomEffect("load", "1000 * speed"),))
    for plant in (
        partial(drive, pushed, plant="planar", timestep_s=STEP_S),
        PlanarDrives(pushed, STEP_S).drive,
    ):
        with pytest.raises(SimulationDivergedError):
            plant(COMMANDS, 4.0)


@pytest.mark.parametrize("name", [one.name for one in CATALOGUE.values() if "planar" in one.refused_by])
def test_an_effect_that_the_plant_refuses_is_refused(name):
    refused = clear_model(name, CATALOGUE[name].parameters[0].name)
    with pytest.raises(InputError, match=name):
        PlanarDrives(refused, STEP_S)
