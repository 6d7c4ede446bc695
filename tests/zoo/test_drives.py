"""Drives drawn at random, the path of their commands and the sensors of their logs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sysid.studies.zoo.drives.draw import draw_drive, family_of
from sysid.studies.zoo.drives.drive import Battery, Controller, Link, Sensor
from sysid.studies.zoo.drives.families import FAMILIES
from sysid.studies.zoo.drives.sensor import Motion, sample
from sysid.studies.zoo.drives.set_point import arrivals, set_points, target_rpm
from sysid.studies.zoo.drives.simulate import simulate
from sysid.studies.zoo.drives.trial import try_out

RPM = 60.0 / (2.0 * math.pi)


@pytest.fixture
def steady():
    """A wheel and its motor at 60 rpm for 3 s."""
    time_s = np.arange(-0.2, 3.0, 5e-4)
    speed = np.full_like(time_s, 2.0 * math.pi)
    angle = 2.0 * math.pi * time_s
    return Motion(time_s, angle, speed, angle, speed, np.full_like(time_s, 24.0))


def generator(seed=0):
    return np.random.default_rng(seed)


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_every_family_can_be_drawn_and_is_useful(family):
    drive = draw_drive(1, family)
    assert drive.family == family
    assert try_out(drive).useful


def test_a_seed_has_one_drive():
    assert draw_drive(7) == draw_drive(7) == draw_drive(7, family_of(7))
    assert draw_drive(7) != draw_drive(8)


def test_fifty_seeds_write_finite_logs_of_many_kinds():
    tops, rates = [], []
    for seed in range(50):
        drive = draw_drive(seed)
        commands = np.repeat([0.0, 0.6 * drive.top_rpm], math.ceil(1.5 / drive.link.period_s))
        log = simulate(drive, commands, generator(seed))
        assert np.isfinite(log.speed_rpm).all()
        assert (np.diff(log.time_s) > 0.0).all()
        assert (log.battery_v is not None) == drive.battery.logged
        assert len(log.time_s) == len(log.command_rpm) == len(log.speed_rpm)
        tops.append(drive.top_rpm)
        rates.append(drive.controller.loop_hz)
        assert log.speed_rpm[-1] > 0.2 * drive.top_rpm
    assert max(tops) > 5.0 * min(tops)
    assert max(rates) > 20.0 * min(rates)
    assert len({family_of(seed) for seed in range(50)}) == len(FAMILIES)


def test_a_command_arrives_after_the_delay_and_a_tick(drive):
    late = replace(drive, link=Link(period_s=0.1, delay_s=0.035))
    ticks_s = np.arange(0, 1.0, 0.001)
    points = set_points(late, np.repeat([0.0, 60.0], 5), ticks_s, generator())
    assert ticks_s[np.argmax(points > 0.0)] == pytest.approx(0.535, abs=0.0011)
    assert points[-1] == pytest.approx(2.0 * math.pi)


def test_a_lost_command_leaves_the_one_before():
    times, values = arrivals(Link(period_s=0.1, loss=0.3), np.arange(1000.0), generator())
    assert len(values) == pytest.approx(700, abs=50)
    assert np.allclose(times, 0.1 * values)


def test_the_delay_changes_only_with_the_command():
    link = Link(period_s=0.1, delay_s=0.05, jitter_s=0.01)
    times, _ = arrivals(link, np.repeat([0.0, 10.0, 20.0], 10), generator())
    late = times - 0.1 * np.arange(30)
    assert np.unique(late.round(9)).size == 3
    assert (np.diff(times) >= 0.0).all()


@pytest.mark.parametrize(
    ("changes", "command_rpm", "expected_rpm"),
    [
        ({"dead_zone_rpm": 5.0}, [-4.0, 8.0], [0.0, 8.0]),
        ({"dead_zone_rpm": 5.0, "dead_zone": "subtract"}, [-4.0, 8.0], [0.0, 3.0]),
        ({"quantum_rpm": 3.0}, [4.0, 8.0], [3.0, 9.0]),
        ({"gain": 0.9, "reverse_gain": 0.5}, [10.0, -10.0], [9.0, -4.5]),
        ({"offset_rpm": 2.0}, [0.0, 10.0], [2.0, 12.0]),
        ({"curve_rpm": ((10.0, 20.0), (20.0, 30.0))}, [-5.0, 30.0], [-10.0, 40.0]),
        ({"gain_hysteresis": 0.1}, [10.0, 5.0], [10.0, 4.5]),
        ({"ceiling_rpm": 7.0}, [5.0, -9.0], [5.0, -7.0]),
        ({"gain_fall_per_s": 0.1}, [10.0, 10.0], [10.0, 9.0]),
        ({"gain_per_volt": 0.1}, [10.0, 10.0], [10.0, 8.0]),
        ({"gain_warming": 0.2, "gain_warming_s": 0.05}, [10.0, 10.0], [10.0, 8.0]),
    ],
)
def test_each_part_of_the_set_point_does_what_it_says(changes, command_rpm, expected_rpm):
    control = Controller("p", 1000.0, **changes)
    battery = Battery(fall_v_per_s=2.0)
    value = target_rpm(control, battery, np.array(command_rpm), np.array([0.0, 1.0]))
    assert value == pytest.approx(expected_rpm, abs=1e-6)


def test_a_soft_ceiling_bends_before_it_holds():
    control = Controller("p", 1000.0, ceiling_rpm=100.0, ceiling_softness_rpm=5.0)
    value = target_rpm(control, Battery(), np.array([0.0, 50.0, 100.0, 200.0]), np.zeros(4))
    assert value == pytest.approx([0.0, 50.0, 100.0 - 5.0 * math.log(2.0), 100.0], abs=1e-3)


def test_ramp_brake_and_jerk_bound_the_set_point(drive):
    control = replace(drive.controller, ramp_rpm_s=200.0, brake_rpm_s=400.0, jerk_rpm_s2=2000.0)
    ticks_s = np.arange(0.0, 4.0, 0.001)
    commands = np.repeat([0.0, 100.0, 0.0], [1, 19, 20])
    points = set_points(replace(drive, controller=control), commands, ticks_s, generator()) * RPM
    rate = np.diff(points) / 0.001
    assert rate.max() == pytest.approx(200.0, rel=1e-6)
    assert rate.min() == pytest.approx(-400.0, rel=1e-6)
    assert np.abs(np.diff(rate)).max() / 0.001 < 1.1 * 2000.0
    assert points.max() < 100.1
    assert points[-1] == 0.0


def test_the_counts_of_an_encoder_give_the_speed(steady):
    rows = sample(Sensor(0.0237, counts=500, window_s=0.051, scale=1.1), steady, 2.0, generator())
    assert rows.speed_rpm.mean() == pytest.approx(66.0, rel=2e-3)
    quantum_rpm = 1.1 * 60.0 / (500 * 0.051)
    assert np.ptp(rows.speed_rpm) == pytest.approx(quantum_rpm)


@pytest.mark.parametrize(("counts", "window_s"), [(0, 0.0), (0, 0.02), (20000, 0.01)])
def test_an_eccentric_disk_swings_the_speed_by_its_share(steady, counts, window_s):
    rows = sample(
        Sensor(0.005, counts=counts, window_s=window_s, eccentricity=0.05), steady, 2.0, generator()
    )
    assert np.ptp(rows.speed_rpm) == pytest.approx(2.0 * 0.05 * 60.0, rel=0.12)


def test_stamps_are_even_uneven_or_late(steady):
    even, uneven, late = (
        sample(Sensor(0.01, stamps=kind, jitter_s=0.002), steady, 2.0, generator())
        for kind in ("even", "uneven", "late")
    )
    assert np.allclose(np.diff(even.time_s), 0.01)
    assert np.array_equal(uneven.time_s, uneven.taken_s)
    assert np.std(np.diff(uneven.time_s)) > 0.001
    assert np.array_equal(late.taken_s, even.time_s)
    assert (late.time_s >= late.taken_s).all()
    assert all((np.diff(rows.time_s) > 0.0).all() for rows in (even, uneven, late))


def test_a_late_filtered_sensor_follows_late(drive):
    plain = replace(drive, sensor=Sensor(0.005))
    slow = replace(drive, sensor=Sensor(0.005, late_s=0.03, filter_s=0.02))
    commands = np.repeat([0.0, 100.0], 10)
    reached = []
    for one in (plain, slow):
        log = simulate(one, commands, generator())
        reached.append(np.sum(100.0 - log.speed_rpm[log.time_s > 1.0]) / 100.0 * 0.005)
    # The area between command and speed grows by the whole lag.
    assert reached[1] - reached[0] == pytest.approx(0.05, abs=0.002)


def test_wild_and_held_samples_have_their_shares(steady):
    wild = sample(Sensor(0.001, outlier_share=0.1), steady, 2.0, generator()).speed_rpm
    assert np.mean(np.abs(wild - 60.0) > 1.0) == pytest.approx(0.1, abs=0.03)
    held = sample(Sensor(0.001, noise_rpm=1.0, held_share=0.2), steady, 2.0, generator()).speed_rpm
    assert np.mean(np.diff(held) == 0.0) == pytest.approx(0.2, abs=0.04)


def test_the_log_has_the_command_as_it_was_sent(drive):
    log = simulate(replace(drive, link=Link(0.1, delay_s=0.05)), np.array([0.0, 10.0, 20.0]), generator())
    assert log.command_rpm[log.time_s.round(9) == 0.1] == 10.0
    assert log.command_rpm[log.time_s.round(9) == 0.09] == 0.0
    assert log.command_rpm[-1] == 20.0


def test_a_logged_battery_falls_as_the_supply_does(drive):
    tired = replace(
        drive,
        battery=Battery(logged=True, full_v=24.0, fall_v_per_s=0.5),
        motor=replace(drive.motor, supply_fall_per_s=0.01),
    )
    volts = simulate(tired, np.zeros(20), generator()).battery_v
    assert volts[0] == 24.0
    assert volts[-1] == pytest.approx(24.0 - 2.0 * (0.5 + 0.24), abs=0.011)
