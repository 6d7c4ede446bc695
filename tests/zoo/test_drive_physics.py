"""The zoo's drives obey the laws that a motor, a gear and a controller obey: one law each."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sysid.studies.zoo.drives.drive import Controller
from sysid.studies.zoo.drives.simulate import move, simulate

RPM = 60.0 / (2.0 * math.pi)


def with_gear(drive, **changes):
    return replace(drive, gear=replace(drive.gear, **changes))


def with_motor(drive, **changes):
    return replace(drive, motor=replace(drive.motor, **changes))


def with_control(drive, **changes):
    return replace(drive, controller=replace(drive.controller, **changes))


@pytest.mark.parametrize("side", ["motor_coulomb_n_m", "wheel_coulomb_n_m"])
def test_friction_costs_a_p_drive_torque_over_stiffness(drive, last_rpm, side):
    # Stiffness k/R (kp + k) = 0.5 N m s.
    assert 100.0 - last_rpm(with_gear(drive, **{side: 0.2}), 100.0) == pytest.approx(0.4 * RPM, rel=1e-3)


def test_a_load_costs_as_much_as_friction_of_its_size(drive, last_rpm):
    assert last_rpm(drive, 100.0, load_n_m=-0.2) == pytest.approx(
        last_rpm(with_gear(drive, wheel_coulomb_n_m=0.2), 100.0), abs=0.01
    )


def test_friction_costs_an_integral_drive_nothing(drive, last_rpm):
    integral = with_control(with_gear(drive, wheel_coulomb_n_m=0.2), family="pi", ki=5.0)
    assert last_rpm(integral, 100.0) == pytest.approx(100.0, abs=0.01)


def test_friction_costs_a_cascade_torque_over_its_own_stiffness(drive, last_rpm):
    control = Controller("cascade", 1000.0, kp=2.0, current_kp=1.0, current_ki=2000.0)
    cascade = replace(
        with_gear(with_motor(drive, current_limit_a=20.0), wheel_coulomb_n_m=0.2), controller=control
    )
    assert 100.0 - last_rpm(cascade, 100.0) == pytest.approx(0.2 / (0.5 * 2.0) * RPM, rel=1e-3)


def test_open_duty_turns_at_volts_over_emf_less_the_friction(drive, last_rpm):
    control = Controller("open_duty", 500.0, feed_forward=0.5)
    opened = replace(with_gear(drive, motor_coulomb_n_m=0.1, wheel_viscous_n_m_s=0.05), controller=control)
    volts = 0.5 * 200.0 / RPM
    # k (V - k w) / R = F + b w
    expected = (0.5 * volts - 0.1) / (0.25 + 0.05)
    assert last_rpm(opened, 200.0) == pytest.approx(expected * RPM, rel=1e-4)


def test_compensation_of_the_resistance_gives_back_its_share_of_the_droop(drive, last_rpm):
    control = Controller("open_duty_compensated", 1000.0, feed_forward=0.5, emf_compensation=0.6)
    opened = replace(with_gear(drive, wheel_coulomb_n_m=0.1), controller=control)
    assert 100.0 - last_rpm(opened, 100.0) == pytest.approx(0.4 * 0.1 / 0.25 * RPM, rel=1e-3)


def test_the_current_limit_bounds_the_acceleration(drive):
    limited = with_motor(with_gear(drive, wheel_coulomb_n_m=0.2), current_limit_a=2.0)
    motion = move(limited, np.full(20, 300.0), np.random.default_rng(0))
    fastest = np.max(np.diff(motion.wheel_rad_s) / np.diff(motion.time_s))
    assert fastest == pytest.approx((0.5 * 2.0 - 0.2) / 4e-3, rel=1e-6)


def test_a_weaker_brake_only_slows_the_stop(drive):
    def times(limited):
        commands = np.repeat([200.0, 0.0], 20)
        motion = move(limited, commands, np.random.default_rng(0))
        speed = motion.wheel_rad_s * RPM
        up = motion.time_s[np.argmax(speed > 100.0)]
        falling = motion.time_s > 2.0
        return up, motion.time_s[falling][np.argmax(speed[falling] < 100.0)]

    up, down = times(with_motor(drive, current_limit_a=4.0))
    weak_up, weak_down = times(with_motor(drive, current_limit_a=4.0, brake_current_a=1.0))
    assert weak_up == up
    assert weak_down - 2.0 > 3.0 * (down - 2.0)


def test_a_stuck_wheel_stays_until_the_torque_breaks_it_loose(drive, last_rpm):
    stuck = with_gear(drive, wheel_coulomb_n_m=0.1, wheel_sticking_n_m=0.2, sticking_rad_s=0.02)
    # At rest the drive pulls with k/R (kp + feed-forward) per rad/s.
    breakaway_rpm = 0.3 / 0.5 * RPM
    assert last_rpm(stuck, 0.98 * breakaway_rpm) == 0.0
    loose_rpm = 1.02 * breakaway_rpm - 0.1 / 0.5 * RPM
    assert last_rpm(stuck, 1.02 * breakaway_rpm) == pytest.approx(loose_rpm, rel=1e-3)


def test_play_passes_a_reversal_late_by_the_gap(drive):
    loose = with_gear(drive, play_deg=4.0, wheel_coulomb_n_m=0.01)
    # Slow enough that the wheel rests as soon as nothing pushes it.
    motion = move(loose, np.repeat([5.0, -5.0], 20), np.random.default_rng(0))
    lead = np.degrees(motion.motor_rad - motion.wheel_rad)
    assert lead[motion.time_s < 1.9][-1] == pytest.approx(2.0, abs=1e-6)
    assert lead[-1] == pytest.approx(-2.0, abs=1e-6)
    back = motion.time_s > 2.0
    motor_turned = motion.time_s[back][np.argmax(motion.motor_rad_s[back] < -0.2)]
    wheel_turned = motion.time_s[back][np.argmax(motion.wheel_rad_s[back] < -0.2)]
    assert wheel_turned - motor_turned == pytest.approx(math.radians(4.0) * RPM / 5.0, rel=0.15)


def test_without_motor_a_wheel_in_play_keeps_momentum(drive):
    free = with_motor(with_gear(drive, play_deg=3.0), back_emf_v_s=1e-6)
    free = with_control(free, kp=0.0, feed_forward=0.0)
    motion = move(free, np.zeros(20), np.random.default_rng(0), load_n_m=1e-3)
    momentum = 3e-3 * motion.motor_rad_s + 1e-3 * motion.wheel_rad_s
    assert momentum[-1] == pytest.approx(1e-3 * motion.time_s[-1], rel=1e-3)


def test_a_supply_that_falls_slows_an_open_drive(drive, last_rpm):
    opened = replace(drive, controller=Controller("open_duty", 500.0, feed_forward=0.5))
    weak = with_motor(opened, supply_fall_per_s=0.05)
    # The last 0.2 s of 3 s are 2.9 s after the start on average.
    assert last_rpm(weak, 100.0) == pytest.approx(last_rpm(opened, 100.0) * (1.0 - 0.05 * 2.9), rel=2e-3)
    kept = with_control(weak, supply_compensation=True)
    assert last_rpm(kept, 100.0) == pytest.approx(100.0, rel=1e-3)


def test_warm_friction_is_smaller(drive, last_rpm):
    warm = with_gear(drive, wheel_coulomb_n_m=0.2, friction_warming=0.5, friction_warming_s=0.1)
    assert 100.0 - last_rpm(warm, 100.0) == pytest.approx(0.2 * RPM, rel=1e-3)


def test_half_the_step_hardly_changes_the_speed(drive):
    rough = with_gear(
        drive,
        wheel_coulomb_n_m=0.05,
        wheel_sticking_n_m=0.03,
        motor_coulomb_n_m=0.05,
        play_deg=1.0,
        cogging_n_m=0.02,
    )
    commands = np.repeat([0.0, 100.0, -60.0, 5.0], 10)
    coarse, fine = (move(rough, commands, np.random.default_rng(1), step_s=s) for s in (1e-4, 5e-5))
    difference = np.interp(coarse.time_s, fine.time_s, fine.wheel_rad_s) - coarse.wheel_rad_s
    assert np.sqrt(np.mean(difference**2)) * RPM < 0.5


def test_an_encoder_in_the_loop_keeps_the_mean_speed(drive, last_rpm):
    seen = with_control(drive, family="pi", ki=5.0, encoder_counts=500, encoder_window_s=0.01)
    assert last_rpm(seen, 100.0) == pytest.approx(100.0, rel=5e-3)


def test_the_same_seed_writes_the_same_log(drive):
    noisy = replace(drive, sensor=replace(drive.sensor, noise_rpm=1.0, stamps="late", jitter_s=1e-3))
    first, second = (simulate(noisy, np.full(10, 50.0), np.random.default_rng(5)) for _ in range(2))
    assert np.array_equal(first.speed_rpm, second.speed_rpm)
    assert np.array_equal(first.time_s, second.time_s)
    other = simulate(noisy, np.full(10, 50.0), np.random.default_rng(6))
    assert not np.array_equal(first.speed_rpm, other.speed_rpm)
