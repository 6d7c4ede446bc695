"""What each suspect can and cannot do to the paper's drive_metrics, on the simulated drives."""

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.law.metrics import step_metrics
from mecanum_env.simulator import BodyCommands, drive
from mecanum_env.units import RAD_S_PER_RPM
from sysid.studies.paper_gap.drives import PAPER, TOLERANCE, drive_metrics, loss_and_rise, turn_losses
from sysid.studies.paper_gap.sets import Fitter

HOLD_S = 1.2
STRAIGHT = slice(0, 4)
SPEEDS_RPM = np.array([10.0, 40.0, 80.0, 130.0])


def with_effects(model, **effects):
    return drive_metrics(replace(model, effects=effects), hold_s=HOLD_S)


@pytest.fixture(scope="module")
def packaged():
    from mecanum_env.model import paper_model

    return paper_model()


@pytest.fixture(scope="module")
def plain(packaged):
    return drive_metrics(packaged, hold_s=HOLD_S)


def test_loss_and_rise_are_read_off_the_measured_speed(packaged):
    path = drive(packaged, BodyCommands.constant(40.0), HOLD_S, plant="planar")
    loss, rise = loss_and_rise(path, 40.0, 0.0)
    speed = path.twist[:, 0]
    end = float(np.mean(speed[path.time_s >= 0.8 * path.time_s[-1]]))
    assert loss == pytest.approx(1.0 - end / (40.0 * RAD_S_PER_RPM * packaged.robot.wheel_radius_m), abs=1e-9)
    expected = step_metrics(path.time_s, speed, 0.0, end, noise_rpm=0.0).rise_time_s
    assert rise == pytest.approx(expected, rel=1e-6)


def test_a_robot_that_never_moves_loses_everything(packaged):
    found = with_effects(packaged, command_deadband={"threshold_rpm": 20.0})
    assert found.losses[0] == pytest.approx(1.0)
    assert found.rises_s[0] == pytest.approx(HOLD_S, abs=0.01)


@pytest.mark.parametrize("effect", ["sensor_latency", "command_latency"])
def test_latency_changes_none_of_the_six(packaged, plain, effect):
    late = with_effects(packaged, **{effect: {"delay_s": 0.1}})
    assert np.all(np.abs(late.six - plain.six) < 0.2 * TOLERANCE)


def test_load_slows_the_rise_and_costs_no_speed(packaged, plain):
    loaded = with_effects(packaged, payload={"mass_kg": 15.0})
    assert np.allclose(loaded.losses, plain.losses, atol=1e-3)
    assert loaded.six[-1] > plain.six[-1] + 0.03


def test_constant_friction_costs_the_same_rpm_so_its_loss_falls_with_speed(packaged):
    losses = with_effects(packaged, coulomb_friction={"torque_n_m": 0.4}).losses[STRAIGHT]
    lost_rpm = losses * SPEEDS_RPM
    assert lost_rpm == pytest.approx(
        np.full(4, 0.4 / packaged.robot.servo_n_m_s_rad / RAD_S_PER_RPM), rel=0.02
    )
    assert np.all(np.diff(losses) < 0.0)


def test_friction_costs_no_speed_where_the_drive_integrates(packaged):
    robot = replace(packaged.robot, servo_integral_n_m_rad=50.0)
    losses = with_effects(replace(packaged, robot=robot), coulomb_friction={"torque_n_m": 0.4}).losses
    assert np.all(np.abs(losses[STRAIGHT]) < 2e-3)


def test_a_gain_costs_the_same_share_at_every_speed(packaged):
    losses = with_effects(packaged, speed_gain={"gain": 0.85}).losses[STRAIGHT]
    assert losses == pytest.approx(np.full(4, 0.15), abs=2e-3)


def test_one_ceiling_cannot_lose_at_80_what_the_paper_loses_and_still_reach_what_it_reaches_at_130(packaged):
    reached_rpm = SPEEDS_RPM * (1.0 - PAPER[STRAIGHT])
    limit = float(reached_rpm[2])
    losses = with_effects(packaged, speed_saturation={"limit_rpm": limit}).losses
    assert losses[2] == pytest.approx(PAPER[2], abs=2e-3)
    assert losses[0] == pytest.approx(0.0, abs=2e-3)
    assert losses[3] > PAPER[3] + 0.1


def test_what_acts_on_wheels_slows_a_turn_as_it_slows_driving(packaged):
    model = replace(packaged, effects={"coulomb_friction": {"torque_n_m": 0.8}})
    straight = drive_metrics(model, hold_s=HOLD_S).losses[STRAIGHT]
    turning = turn_losses(model, SPEEDS_RPM) - turn_losses(packaged, SPEEDS_RPM)
    assert turning == pytest.approx(straight, abs=0.02)


def test_a_fit_finds_sizes_that_were_put_in(packaged):
    """Fitted to all six printed drive_metrics, a gain ends where it leaves least."""
    fitter = Fitter(packaged)
    found = fitter.fit(fitter.start(fitter.empty(), "speed_gain"))
    (values,) = found.values.values()
    around = [fitter.at(found.chosen, found.place + step).misfit for step in (-0.05, 0.05)]
    assert 0.5 < values["gain"] < 1.0
    assert found.misfit < min(around)
    assert found.misfit < fitter.empty().misfit
