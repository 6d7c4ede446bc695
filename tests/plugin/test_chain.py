"""The batched Python reference of the whole chain and the C library's loop give the same bits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mecanum_env.plugin.library import HeldCommands, free_wheels, refusal
from mecanum_env.wheel_drive.formula import compile_formula
from mecanum_env.wheel_drive.free_wheel import free_wheel_speeds
from mecanum_env.wheel_drive.link import SPREAD
from mecanum_env.wheel_drive.parameters import CHAIN
from mecanum_env.wheel_drive.program import PROGRAM_SIZE
from mecanum_env.wheel_drive.set_point import MAP_KNOTS, MAP_PARAMETERS, map_numbers
from mecanum_env.wheel_drive.wheel_load import GAP_KINDS

RANGES = {
    "command_quantum_rpm": (0.1, 3.0),
    "saturation_rpm": (20.0, 150.0),
    "servo_integral_n_m_rad": (0.1, 30.0),
    "delay_s": (0.0, 0.2),
    "deadband_rpm": (1.0, 40.0),
    "gain": (0.5, 1.5),
    "reverse_ratio": (0.5, 1.5),
    "drop_per_s": (0.01, 0.5),
    "softness_rpm": (1.0, 80.0),
    "acceleration_rpm_s": (50.0, 5000.0),
    "gap_rad": (0.01, 0.3),
    "breakaway_n_m": (0.01, 1.0),
    "stribeck_rad_s": (0.05, 3.0),
    "coulomb_n_m": (0.01, 1.0),
    "drive_acceleration_rpm_s": (50.0, 5000.0),
    "drive_brake_rpm_s": (50.0, 5000.0),
    "supply_rpm": (20.0, 150.0),
    "supply_share": (0.01, 1.0),
    "rotor_kg_m2": (1e-3, 1e-1),
    "viscous_n_m_s_rad": (0.01, 0.5),
    "friction_warm_share": (0.1, 1.0),
    "friction_warm_s": (0.05, 5.0),
    "ripple_n_m": (0.01, 1.0),
    "ripple_share": (0.01, 0.5),
    "ripple_per_turn": (1.0, 24.0),
    "ripple_phase_rad": (-3.0, 3.0),
    "subtracted_rpm": (1.0, 40.0),
    "warm_up_share": (-0.9, 0.9),
    "warm_up_s": (0.05, 5.0),
    "brake_rpm_s": (50.0, 5000.0),
    "jerk_rpm_s2": (300.0, 1e6),
    "loss": (0.01, 0.9),
    "link_seed": (1.0, 2.0**53),
    "gain_per_volt": (0.01, 0.5),
    "supply_per_volt": (0.01, 0.5),
    "gap_swing_rad_s": (1.0, 300.0),
    "gap_damping": (0.01, 1.0),
    "gap_slowing_rad_s2": (1.0, 1000.0),
    "servo_windup": (0.1, 1.0),
    "windup": (0.1, 1.0),
    "viscous_warm_share": (0.1, 1.0),
}
"""Parameters that may be 0, and the range of their other values."""
STEERING = ("voltage", "sin(5 * time)", "sign(command)", "min(abs(speed), 3) * cos(angle)", "exp(-time)")
LOADS = (
    "sign(speed)",
    "speed",
    "0.1 * speed * sin(3 * angle)",
    "exp(-abs(command) / 20)",
    "sign(speed) * time",
    "0.02 * speed * voltage",
)
STEPS = 150


def random_row(rng, law, sample_period_s, command_period_s):
    values = dict.fromkeys(CHAIN, 0.0)
    for name, (low, high) in RANGES.items():
        values[name] = float(rng.choice([0.0, rng.uniform(low, high)]))
    values |= dict(zip("ABCDEF", law.coefficients.tolist(), strict=True))
    values |= {"sample_period_s": sample_period_s, "command_period_s": command_period_s}
    values["servo_n_m_s_rad"] = float(np.exp(rng.uniform(np.log(0.05), np.log(20.0))))
    values["torque_limit_n_m"] = float(rng.choice([1e10, rng.uniform(0.1, 2.0)]))
    values["inertia_kg_m2"] = values["rotor_kg_m2"] + float(rng.uniform(1e-4, 1e-2))
    room = min(0.1, (29 * command_period_s - 0.02 - values["delay_s"]) / SPREAD)  # what the ring can hold
    values["jitter_s"] = float(rng.choice([0.0, rng.uniform(0.0, room)]))
    values["gap_kind"] = float(rng.integers(len(GAP_KINDS)))
    values |= map_numbers(*random_map(rng))
    return [*(values[name] for name in CHAIN), *random_programs(rng)]


def random_programs(rng):
    """Return the programs of the three stations, each empty or a random one."""
    found = []
    for formulas in (STEERING, STEERING, LOADS):
        scale, text = float(rng.uniform(-3.0, 3.0)), rng.choice([*formulas, "0", "0"])
        program = () if text == "0" else compile_formula(f"{scale!r} * {text}")
        found += [*program, *[0.0] * (PROGRAM_SIZE - len(program))]
    return found


def random_map(rng):
    """Return the knots and values of a static map, mirrored or not, or of none."""
    count = int(rng.choice([0, rng.integers(1, MAP_KNOTS + 1)]))
    knots, values = np.sort(rng.uniform(-120.0, 120.0, (2, count)), axis=1)
    if count and (knots[-1] < 0.0 or knots[0] >= 0.0 or rng.random() < 0.5):
        knots, values = np.sort(np.abs([knots, values]), axis=1)
        if rng.random() < 0.3:
            knots[0] = values[0] = 0.0
    return knots.tolist(), values.tolist()


def loop(rows, wheels, timestep, commands, initial, lost_v=None, gap_share=0.0):
    """Return what the library's loop gives, shape (sets, runs, steps + 1)."""
    times = np.arange(commands.shape[1]) * timestep
    runs = [(times, row, float(speed)) for row, speed in zip(commands, initial, strict=True)]
    held = HeldCommands.of(runs, gap_share)
    steps = np.full(len(commands), commands.shape[1])
    speeds, _ = free_wheels(rows, wheels, timestep, held, steps, None if lost_v is None else lost_v.ravel())
    return speeds.reshape(len(rows), len(commands), -1)


def test_every_parameter_is_varied():
    fixed = {*"ABCDEF", "sample_period_s", "command_period_s", "servo_n_m_s_rad", "torque_limit_n_m"}
    assert {*RANGES, *fixed, "inertia_kg_m2", "gap_kind", "jitter_s", "map_knots", *MAP_PARAMETERS} == set(
        CHAIN
    )


# Each example has twelve drives with parameters of their own.
@settings(max_examples=12)
@given(
    seed=st.integers(0, 2**32 - 1),
    timestep=st.sampled_from([1 / 480, 1 / 240, 0.0031, 0.02]),
    periods=st.lists(
        st.tuples(
            st.sampled_from([1 / 120, 0.01, 0.0073, 1 / 480, 0.05]),
            st.sampled_from([0.1, 0.02, 1 / 120, 0.033]),
        ),
        min_size=4,
        max_size=4,
    ),
)
def test_sets_and_runs_at_once_equal_the_loop_bit_for_bit(stable_law, seed, timestep, periods):
    rng = np.random.default_rng(seed)
    rows = np.array([random_row(rng, stable_law(rng), *pair) for pair in periods])
    wheels = np.stack([rows[:, CHAIN.index("inertia_kg_m2")], rng.choice([0.0, 0.1], len(rows))], axis=1)
    commands = np.repeat(rng.uniform(-160.0, 160.0, (3, STEPS // 10)), 10, axis=1)
    commands[0, 40:60] = 0.0
    initial = rng.choice([0.0, 40.0, -70.0], 3)
    for row in rows:
        assert refusal(row, timestep) is None
    lost_v = np.repeat(rng.uniform(-1.0, 4.0, (3, STEPS // 10)), 10, axis=1)
    starts = rng.uniform(-1.0, 1.0, 3)
    found = free_wheel_speeds(rows, wheels, timestep, commands, initial, lost_v, starts)
    np.testing.assert_array_equal(found, loop(rows, wheels, timestep, commands, initial, lost_v, starts))


# The loop takes a shorter way where nothing acts behind the set-point; each of these must be told from that.
@pytest.mark.parametrize(
    "acting",
    [
        *((name,) for name in (*RANGES, "torque_limit_n_m", "program 0", "program 1", "program 2")),
        ("viscous_n_m_s_rad", "viscous_warm_share", "friction_warm_s"),
        ("breakaway_n_m", "stribeck_rad_s"),
        (),
    ],
    ids=" ".join,
)
def test_each_parameter_alone_is_the_same_in_both(acting):
    values = dict.fromkeys(CHAIN, 0.0) | dict(zip("ADE", (0.6, 0.3, 0.1), strict=True))
    values |= {"sample_period_s": 1 / 120, "command_period_s": 0.1, "servo_n_m_s_rad": 0.8}
    values |= {"inertia_kg_m2": 3e-3, "torque_limit_n_m": 1e10, "ripple_per_turn": 6.0}
    programs = [(), (), ()]
    for name in acting:
        if name.startswith("program"):
            programs[int(name[-1])] = compile_formula("0.2 * speed * cos(angle)")
        else:
            values[name] = 0.2 if name == "torque_limit_n_m" else float(np.mean(RANGES[name]))
    padded = [number for one in programs for number in (*one, *[0.0] * (PROGRAM_SIZE - len(one)))]
    rows, wheels = np.array([[*values.values(), *padded]]), np.array([[3e-3, 0.05]])
    commands = np.repeat(np.array([[60.0, -30.0, 0.0, 90.0]]), 60, axis=1)
    lost_v = np.linspace(0.0, 2.0, commands.size)[None]
    assert refusal(rows[0], 1 / 480) is None
    found = free_wheel_speeds(rows, wheels, 1 / 480, commands, np.zeros(1), lost_v, np.array([0.5]))
    expected = loop(rows, wheels, 1 / 480, commands, np.zeros(1), lost_v, np.array([0.5]))
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("also", [{}, {"inertia_kg_m2": 0.0}])
def test_a_heavier_wheel_than_the_drive_knows_of_is_the_same_in_both(stable_law, also):
    rng = np.random.default_rng(3)
    row = dict(zip(CHAIN, random_row(rng, stable_law(rng), 1 / 120, 0.1), strict=False)) | also
    rows, wheels = np.array([list(row.values())] * 2), np.array([[0.01, 0.0], [0.2, 0.3]])
    commands = np.repeat(rng.uniform(-100.0, 100.0, (2, 10)), 48, axis=1)
    found = free_wheel_speeds(rows, wheels, 1 / 480, commands, np.zeros(2))
    np.testing.assert_array_equal(found, loop(rows, wheels, 1 / 480, commands, np.zeros(2)))
    assert np.all(np.isfinite(found))
