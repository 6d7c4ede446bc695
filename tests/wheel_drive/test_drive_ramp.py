"""The acceleration limit, a continuous ramp whose mean is the law's input, and the soft saturation."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.model import paper_model
from mecanum_env.wheel_drive.drive import DriveParameters
from mecanum_env.wheel_drive.inputs import latched_commands
from mecanum_env.wheel_drive.set_point import saturated

FINE = 2000  # parts of a tick


def ramp_means(drive: DriveParameters, commands, ticks):
    """Follow the delayed command in small steps; return the mean over each tick [rpm]."""
    tau = drive.law.sample_period_s
    step, ramp = tau / FINE, 0.0
    times = (np.arange(ticks * FINE) + 0.5) * step
    which = np.floor((times - drive.delay_s) / drive.command_period_s).astype(int)
    target = np.where(which < 0, 0.0, np.asarray(commands)[np.clip(which, 0, len(commands) - 1)])
    rise, ramps = drive.acceleration_rpm_s, np.empty(len(target))
    for n, wanted in enumerate(target):
        falls = (wanted - ramp) * ramp < 0.0
        most = (drive.brake_rpm_s or rise if falls else rise) * step
        before, ramp = ramp, ramp + min(max(wanted - ramp, -most), most)
        ramps[n] = (before + ramp) / 2
    return ramps.reshape(ticks, FINE).mean(axis=1)


@given(
    commands=st.lists(st.integers(-120, 120), min_size=3, max_size=3),
    limit=st.floats(50.0, 20_000.0),
    brake=st.just(0.0) | st.floats(50.0, 20_000.0),
    delay=st.floats(0.0, 0.03),
)
def test_the_input_is_the_mean_of_the_ramp(commands, limit, brake, delay):
    drive = replace(
        paper_model().wheel.drive_parameters(),
        acceleration_rpm_s=limit,
        brake_rpm_s=brake,
        delay_s=delay,
        command_period_s=1 / 60,  # two ticks
    )
    ticks = 6
    found = latched_commands(drive, np.arange(3) / 60, np.array(commands, float), ticks)
    # A change between two ticks acts from the next tick on, hence whole ticks above.
    np.testing.assert_allclose(found, ramp_means(drive, commands, ticks), atol=0.3)


def test_a_ramp_lags_half_a_tick_behind_its_own_start():
    drive = replace(paper_model().wheel.drive_parameters(), acceleration_rpm_s=120.0)
    found = latched_commands(drive, np.array([0.0]), np.array([6.0]), 8)
    # The ramp rises by 1 rpm per tick; its mean is the value in the middle of the tick.
    assert found == pytest.approx([0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.0, 6.0])


def test_a_ramp_that_ends_within_a_tick_rests_for_the_remainder():
    wheel = replace(paper_model().wheel, command_quantum_rpm=0.0)
    drive = replace(wheel.drive_parameters(), acceleration_rpm_s=120.0)
    found = latched_commands(drive, np.array([0.0]), np.array([1.5]), 3)
    # Half a tick on the ramp, with a mean of 1.25 rpm, and half a tick at the end.
    assert found == pytest.approx([0.5, (1.25 + 1.5) / 2, 1.5])


@pytest.mark.parametrize("command_rpm", [-21.4, 21.4, 22.0, 1e9])
def test_a_knee_of_next_to_no_width_is_a_plain_limit(command_rpm):
    limited = saturated(np.float64(command_rpm), 22.0, 5e-324)
    assert float(limited) == np.clip(command_rpm, -22.0, 22.0)
