"""Motor and PID to law and back; the formulas against an independent simulation of motor and controller."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.errors import InputError
from mecanum_env.law import WheelLaw
from mecanum_env.law.motor import (
    Motor,
    Pid,
    drive_from_law,
    law_from_drive,
    law_from_lumped,
    lump,
    lumped_from_law,
)

PERIOD = 1.0 / 120.0
MOTOR = Motor(2.0, 4e-3, 0.03, 0.031, 2e-5, 1e-5, gear=20.0)
PID = Pid(Kp=0.4, Ki=3.0, Kd=1e-4)


@st.composite
def motors(draw):
    """Draw motors whose electrical time constant is clearly below the mechanical one."""
    resistance, kt = draw(st.floats(0.2, 10.0)), draw(st.floats(0.005, 0.2))
    inertia, damping = draw(st.floats(1e-6, 1e-3)), draw(st.floats(0.0, 1e-3))
    mechanical_s = inertia / damping if damping > 0.0 else np.inf
    electrical_s = min(draw(st.floats(0.0, 0.02)), 0.5 * mechanical_s)
    ke = kt * draw(st.floats(0.8, 1.2))
    gear = draw(st.floats(1.0, 100.0))
    return Motor(resistance, electrical_s * resistance, kt, ke, inertia, damping, gear)


@st.composite
def gains(draw):
    return Pid(draw(st.floats(-1.0, 5.0)), draw(st.floats(0.0, 50.0)), draw(st.floats(-1e-2, 1e-2)))


@given(motors(), gains())
def test_the_coefficients_sum_to_one_for_every_motor_and_gain(motor, pid):
    coefficients = law_from_drive(motor, pid, PERIOD).coefficients
    assert sum(coefficients) == pytest.approx(1.0, abs=1e-12 * np.max(np.abs(coefficients)))


def test_the_law_is_the_controller_and_the_motor_stepped_one_after_the_other():
    law = law_from_drive(MOTOR, PID, PERIOD)
    commands = np.random.default_rng(0).uniform(-10.0, 10.0, 60)
    m, t = MOTOR, PERIOD
    # Voltage accumulates by the incremental PID; the motor's difference equation is solved for w(k+1).
    w, e, u, got = [0.0, 0.0], [0.0, 0.0], 0.0, [0.0]
    second = m.gear * m.inductance * m.inertia / m.torque_constant / t**2
    first = m.gear * (m.inductance * m.damping + m.resistance * m.inertia) / m.torque_constant / t
    zeroth = m.gear * (m.resistance * m.damping / m.torque_constant + m.back_emf)
    for r in commands:
        e = [r - w[-1], *e]
        u += PID.Kp * (e[0] - e[1]) + PID.Ki * t * e[0] + PID.Kd / t * (e[0] - 2 * e[1] + e[2])
        after = (u + (2 * second + first - zeroth) * w[-1] - second * w[-2]) / (second + first)
        w.append(after)
        got.append(after)
    np.testing.assert_allclose(law.simulate(commands), got, rtol=1e-9, atol=1e-9)


def test_a_fine_law_follows_the_continuous_motor():
    # Open loop has no law; a strong P controller with known poles has: compare with the exact solution.
    motor, kp, t = Motor(2.0, 0.0, 0.03, 0.03, 2e-5, 0.0), 0.1, 1e-5
    tau, k0 = motor.resistance * motor.inertia / motor.torque_constant, motor.back_emf
    speeds = law_from_drive(motor, Pid(kp, 0.0, 0.0), t).simulate(np.ones(5000))
    exact = kp / (kp + k0) * (1.0 - np.exp(-np.arange(5001) * t * (kp + k0) / tau))
    np.testing.assert_allclose(speeds, exact, atol=2e-3)


@given(motors(), gains())
def test_lumped_constants_survive_the_law(motor, pid):
    drive = lump(motor, pid)
    law = law_from_lumped(drive, PERIOD)
    back = lumped_from_law(law, drive.a0)
    size = (drive.a2 / PERIOD**2 + drive.a1 / PERIOD) * np.max(np.abs([*law.coefficients, 1.0]))
    digits = size / drive.a0 * 1e-12  # a0 is what is left of terms of this size
    rel = max(1e-9, digits)
    assert back.a1 / PERIOD == pytest.approx(drive.a1 / PERIOD, rel=rel, abs=rel * size)
    assert back.a2 / PERIOD**2 == pytest.approx(drive.a2 / PERIOD**2, rel=rel, abs=rel * size)
    np.testing.assert_allclose(
        [back.pid.Kp, back.pid.Ki * PERIOD, back.pid.Kd / PERIOD],
        [pid.Kp, pid.Ki * PERIOD, pid.Kd / PERIOD],
        rtol=rel,
        atol=rel * size,
    )


def measured(motor):
    return {
        "resistance": motor.resistance,
        "torque_constant": motor.torque_constant,
        "back_emf": motor.back_emf,
        "gear": motor.gear,
        "steady_volts_s_rad": lump(motor, PID).a0,
    }


@given(motors())
def test_the_motor_survives_the_law(motor):
    law = law_from_drive(motor, PID, PERIOD)
    back, pid = drive_from_law(law, **measured(motor))
    assert back.inertia == pytest.approx(motor.inertia, rel=1e-4)
    assert back.inductance / motor.resistance == pytest.approx(motor.inductance / motor.resistance, abs=1e-6)
    assert back.damping == pytest.approx(motor.damping, abs=1e-9)
    np.testing.assert_allclose([pid.Kp, pid.Ki, pid.Kd], [PID.Kp, PID.Ki, PID.Kd], rtol=1e-4)


@given(motors(), gains())
def test_the_law_survives_the_lumped_constants(motor, pid):
    law = law_from_drive(motor, pid, PERIOD).normalised()
    back = law_from_lumped(lumped_from_law(law), PERIOD)
    size = np.max(np.abs(law.coefficients))
    np.testing.assert_allclose(back.coefficients, law.coefficients, rtol=1e-9, atol=1e-9 * size)


def test_the_papers_law_is_a_passive_motor_under_pid(paper):
    drive = lumped_from_law(paper.wheel.law)
    assert drive.a0 == 1.0
    assert drive.a1 > 0.0
    assert drive.a2 > 0.0
    motor, _ = drive_from_law(
        paper.wheel.law,
        resistance=2.0,
        torque_constant=0.03,
        back_emf=0.03,
        gear=20.0,
        steady_volts_s_rad=0.61,
    )
    assert motor.inductance / motor.resistance < motor.inertia / motor.damping


def test_volts_cancel():
    law = law_from_drive(MOTOR, PID, PERIOD)
    drive = lump(MOTOR, PID)
    pid = Pid(*(3.0 * x for x in (PID.Kp, PID.Ki, PID.Kd)))
    scaled = replace(drive, a0=3.0 * drive.a0, a1=3.0 * drive.a1, a2=3.0 * drive.a2, pid=pid)
    np.testing.assert_allclose(law_from_lumped(scaled, PERIOD).coefficients, law.coefficients, rtol=1e-12)


def test_without_inductance_the_law_is_of_reduced_order():
    reduced = law_from_drive(replace(MOTOR, inductance=0.0), PID, PERIOD)
    assert reduced.C == -reduced.F
    second_order = law_from_drive(replace(MOTOR, inductance=0.0), replace(PID, Kd=0.0), PERIOD)
    assert second_order.C == 0.0
    assert second_order.F == 0.0
    almost = law_from_drive(replace(MOTOR, inductance=1e-9), PID, PERIOD)
    np.testing.assert_allclose(almost.coefficients, reduced.coefficients, atol=1e-6)


@pytest.mark.parametrize("name", ["resistance", "torque_constant", "inertia", "gear"])
@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan"), float("inf")])
def test_a_motor_needs_positive_constants(name, bad):
    with pytest.raises(InputError, match=f"{name} = {bad}, must be a finite number above 0"):
        replace(MOTOR, **{name: bad})


@pytest.mark.parametrize("name", ["inductance", "back_emf", "damping"])
def test_a_motor_has_no_negative_constants(name):
    with pytest.raises(InputError, match=f"{name} = -1.0, must be a finite number, 0 or above"):
        replace(MOTOR, **{name: -1.0})


def test_a_law_without_unit_gain_is_refused():
    with pytest.raises(InputError, match=r"= 0\.9, must be 1 .*normalised"):
        lumped_from_law(WheelLaw(0.5, 0.0, 0.0, 0.4, 0.0, 0.0, PERIOD))


def test_a_law_that_no_passive_motor_has_is_refused():
    with pytest.raises(InputError, match=r"a0 = .*, must be above 0"):
        lumped_from_law(WheelLaw(0.5, 0.0, 0.0, 2.0, -1.5, 0.0, PERIOD))


def test_too_little_voltage_is_refused():
    law = law_from_drive(MOTOR, PID, PERIOD)
    with pytest.raises(InputError, match="at least gear"):
        drive_from_law(law, **{**measured(MOTOR), "steady_volts_s_rad": 0.1})


def test_complex_inertia_is_refused():
    law = law_from_drive(replace(MOTOR, inductance=0.05), PID, PERIOD)
    wrong = {**measured(MOTOR), "back_emf": 0.0, "steady_volts_s_rad": 1.0}
    with pytest.raises(InputError, match=r"no real motor .* discriminant -"):
        drive_from_law(law, **wrong)


def test_a_drive_without_inertia_or_period_is_refused():
    with pytest.raises(InputError, match="without inertia"):
        law_from_lumped(replace(lump(MOTOR, PID), a1=0.0, a2=0.0), PERIOD)
    with pytest.raises(InputError, match="must be above 0"):
        law_from_drive(MOTOR, PID, 0.0)
