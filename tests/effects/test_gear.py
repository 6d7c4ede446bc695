"""Textbook signatures of the forms of backlash, and of a torque that follows the wheel's angle."""

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.mjcf import bench_spec
from mecanum_env.simulator import BodyCommands, drive, replay_bench
from mecanum_env.units import RAD_S_PER_RPM

STEP = 1 / 480
TIME = np.arange(0.0, 2.0, STEP)
STAIRS = np.select([TIME < 0.5, TIME < 1.0, TIME < 1.5], [30.0, 60.0, -60.0], -20.0)


def turned_deg(model, command=STAIRS):
    """Return the angle that the wheel has turned through [deg], at each time."""
    return np.cumsum(replay_bench(model, TIME, command)) * RAD_S_PER_RPM * STEP * 180 / np.pi


@pytest.mark.parametrize("gap", [2.0, 8.0, 15.0])
def test_a_resting_wheel_plays_back_what_the_motor_turns_beyond_the_gap(base, gap):
    """The classic hysteresis: the wheel's angle is the motor's, held where the motor crosses the gap."""
    model = base.with_effect("backlash", "rest", gap_deg=gap)
    motor, wheel, followed = turned_deg(base), turned_deg(model), []
    place = 0.0
    for angle in motor:
        place = min(max(place, angle - gap / 2), angle + gap / 2)
        followed.append(place)
    np.testing.assert_allclose(wheel, followed, atol=0.25)


def test_a_resting_wheel_stands_still_at_a_reversal(base):
    speed = replay_bench(base.with_effect("backlash", "rest", gap_deg=15.0), TIME, STAIRS)
    plain = replay_bench(base, TIME, STAIRS)
    crossed = TIME[np.argmax((TIME > 1.0) & (plain < 0.0))]
    still = (crossed + 0.01 < TIME) & (crossed + 0.06 > TIME)
    assert np.max(np.abs(speed[still])) < 0.05
    # Until then friction slows it as the motor does.
    slowing = (TIME > 1.0) & (crossed - 0.01 > TIME)
    np.testing.assert_allclose(speed[slowing], plain[slowing], atol=1e-6)


@pytest.mark.parametrize(("form", "values"), [("rest", {}), ("spring", {"damping": 0.7})])
def test_steady_motion_knows_no_gap(base, form, values):
    loose = base.with_effect("backlash", form, gap_deg=10.0, **values)
    model = loose.with_effect("coulomb_friction", torque_n_m=0.3)
    rigid = base.with_effect("coulomb_friction", torque_n_m=0.3)
    speed, plain = (replay_bench(m, TIME, STAIRS) for m in (model, rigid))
    for end in (0.5, 1.0, 1.5, 2.0):
        late = np.abs(TIME - end + 0.05) < 0.04
        np.testing.assert_allclose(speed[late], plain[late], atol=0.05)


@pytest.mark.parametrize(("swing_hz", "damping"), [(2.0, 0.05), (5.0, 0.1), (8.0, 0.2)])
def test_a_wheel_on_a_spring_swings_with_its_frequency_and_dies_out_with_its_damping(base, swing_hz, damping):
    """A gap that it does not cross: the damped oscillator of the textbook."""
    model = base.with_effect("backlash", "spring", gap_deg=45.0, swing_hz=swing_hz, damping=damping)
    slow, settled = np.full(TIME.shape, 20.0), TIME > 0.6
    swing = (replay_bench(model, TIME, slow) - replay_bench(base, TIME, slow))[settled]
    turns = np.flatnonzero(np.diff(np.sign(np.diff(swing)))) + 1
    slower = np.sqrt(1.0 - damping**2)
    assert 0.5 / (np.mean(np.diff(turns)) * STEP) == pytest.approx(swing_hz * slower, rel=0.02)
    fall = np.abs(swing[turns[1]] / swing[turns[0]])
    assert fall == pytest.approx(np.exp(-np.pi * damping / slower), abs=0.05)


@pytest.mark.parametrize("slowing", [100.0, 400.0])
def test_a_wheel_in_the_gap_slows_down_at_its_own_rate(base, slowing):
    """A motor that brakes harder than friction slows the wheel leaves it alone until the gap is crossed."""
    model = base.with_effect("backlash", "rest", gap_deg=45.0, slowing_rpm_s=slowing)
    alone = (TIME > 1.02) & (TIME < 1.05)
    falls = np.diff(replay_bench(model, TIME, STAIRS)[alone]) / STEP
    np.testing.assert_allclose(falls, -slowing, rtol=0.02)


def test_friction_holds_a_wheel_until_its_spring_is_twisted_so_far(base):
    model = base.with_effect("backlash", "spring", gap_deg=45.0, damping=0.0, friction_deg=5.0)
    speed, motor_deg = replay_bench(model, TIME, STAIRS), turned_deg(base)
    moves = np.argmax(np.abs(speed) > 1e-3)
    assert motor_deg[moves - 2] < 5.0 < motor_deg[moves]
    assert np.all(speed[:moves] == 0.0)


@pytest.mark.parametrize("gap", [2.0, 10.0])
def test_a_spring_keeps_the_wheel_within_the_gap_of_the_motor(base, gap):
    model = base.with_effect("backlash", "spring", gap_deg=gap, swing_hz=2.0)
    lead = turned_deg(base) - turned_deg(model)
    assert np.max(np.abs(lead)) == pytest.approx(gap / 2, abs=0.3)


def test_a_stiff_spring_is_none(base):
    stiff = base.with_effect("backlash", "spring", gap_deg=10.0, swing_hz=50.0, damping=0.7)
    speed, plain = (replay_bench(model, TIME, STAIRS) for model in (stiff, base))
    assert np.sqrt(np.mean((speed - plain) ** 2)) < 1.0


@pytest.mark.parametrize("plant", ["rollers", "planar"])
@pytest.mark.parametrize("form", ["rest", "spring"])
def test_on_the_floor_the_first_start_comes_later(base, plant, form):
    loose, tight = (
        drive(m, BodyCommands.constant(60), 0.8, plant=plant)
        for m in (base.with_effect("backlash", form, gap_deg=10.0), base)
    )
    early = tight.time_s < 0.15
    assert np.sum(tight.twist[early, 0]) > np.sum(loose.twist[early, 0])
    assert loose.twist[-1, 0] == pytest.approx(tight.twist[-1, 0], abs=0.02)


def rippled(base, command, **values):
    model = base.with_effect("torque_ripple", **values)
    return replay_bench(model, TIME, np.full(TIME.shape, float(command)))


@pytest.mark.parametrize("command", [30.0, 90.0, -60.0])
def test_a_torque_ripple_swings_so_many_times_per_turn_in_its_size(base, command):
    speed = rippled(base, command, per_turn=3.0, torque_n_m=0.5)
    angle = np.cumsum(speed) * RAD_S_PER_RPM * STEP
    late = TIME > 1.0
    basis = np.column_stack([np.ones(late.sum()), np.sin(3 * angle[late]), np.cos(3 * angle[late])])
    mean, along, across = np.linalg.lstsq(basis, speed[late], rcond=None)[0]
    full = 0.5 / base.robot.servo_n_m_s_rad / RAD_S_PER_RPM
    assert mean == pytest.approx(command, abs=0.02)
    assert np.hypot(along, across) == pytest.approx(full, rel=0.02)
    assert along == pytest.approx(full, rel=0.02)  # the servo answers at once


@pytest.mark.parametrize("command", [20.0, 80.0])
def test_a_share_makes_the_swing_grow_with_speed(base, command):
    late = rippled(base, command, per_turn=2.0, share=0.1)[TIME > 1.0]
    assert np.ptp(late) / 2 == pytest.approx(0.1 * command, rel=0.05)


@pytest.mark.parametrize("command", [25.0, 50.0, 120.0])
def test_integral_action_works_against_slow_swings(base, command):
    values = {"per_turn": 3.0, "torque_n_m": 0.1, "washout_s": 0.1}
    model = base.with_effect("torque_ripple", "washed_out", **values)
    late = replay_bench(model, TIME, np.full(TIME.shape, command))[TIME > 1.0]
    # A first-order high-pass of the wash-out time at the frequency of the swing.
    turn = 3.0 * command * RAD_S_PER_RPM * 0.1
    full = 0.1 / base.robot.servo_n_m_s_rad / RAD_S_PER_RPM
    assert np.ptp(late) / 2 == pytest.approx(full * turn / np.hypot(1.0, turn), rel=0.05)


def test_the_phase_is_where_the_run_starts(base):
    ahead, behind = (
        rippled(base, 30.0, per_turn=1.0, torque_n_m=0.5, phase_deg=phase) for phase in (90.0, -90.0)
    )
    plain = replay_bench(base, TIME, np.full(TIME.shape, 30.0))
    first = TIME < 0.05
    assert np.mean((ahead - plain)[first]) > 0.5
    assert np.mean((behind - plain)[first]) < -0.5


@pytest.mark.parametrize("plant", ["rollers", "planar"])
def test_on_the_robot_each_wheel_ripples_with_its_own_angle(base, plant):
    model = base.with_effect("torque_ripple", per_turn=3.0, torque_n_m=0.5)
    path, plain = (drive(m, BodyCommands.constant(60), 2.0, plant=plant) for m in (model, base))
    late = path.time_s > 1.0
    assert np.ptp(path.wheels_rpm[late, 0]) > np.ptp(plain.wheels_rpm[late, 0]) + 1.0


def test_drives_without_the_plugin_refuse_them(base):
    rippling = base.with_effect("torque_ripple", torque_n_m=0.1)
    late = base.with_effect("viscous_friction", damping_n_m_s_rad=0.1, answer_s=0.1)
    for model in (rippling, late, base.with_effect("backlash", "rest", gap_deg=1.0)):
        with pytest.raises(InputError, match='need the plugin, drive="plugin"'):
            bench_spec(model, drive="servo")
