"""The parameters of a wheel's drive as numbers in a row: their names and order.

The C library lists the same names (mecanum_env/plugin/parameters.h); a test holds the two equal.
A MuJoCo model has them in the fields of an actuator (`mecanum_env.plugin.layout`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.program import PROGRAM_SIZE
from mecanum_env.wheel_drive.set_point import MAP_PARAMETERS

DYNPRM: Final = (
    *COEFFICIENTS,
    *("sample_period_s", "command_period_s", "command_quantum_rpm", "saturation_rpm"),
)
"""The wheel law, its clocks, and what commands are rounded to and limited to (0: not at all)."""
USER: Final = (
    *("servo_integral_n_m_rad", "delay_s", "torque_limit_n_m"),
    *("deadband_rpm", "gain", "reverse_ratio", "drop_per_s", "softness_rpm", "acceleration_rpm_s"),
    *("gap_rad", "breakaway_n_m", "stribeck_rad_s", "coulomb_n_m", "inertia_kg_m2"),
    *("drive_acceleration_rpm_s", "drive_brake_rpm_s", "supply_rpm", "supply_share"),
    *("rotor_kg_m2", "viscous_n_m_s_rad", "friction_warm_share", "friction_warm_s"),
    *("ripple_n_m", "ripple_share", "ripple_per_turn", "ripple_phase_rad", "gap_kind"),
    *("subtracted_rpm", "warm_up_share", "warm_up_s", "map_knots", *MAP_PARAMETERS),
    *("brake_rpm_s", "jerk_rpm_s2", "jitter_s", "loss", "link_seed"),
    *("gain_per_volt", "supply_per_volt", "gap_swing_rad_s", "gap_damping", "gap_slowing_rad_s2"),
    *("servo_windup", "windup", "viscous_warm_share"),
)
"""The servo and the effects; from "deadband_rpm" on 0 means "off", also for a gain.

The inertia is that of the wheel and its rotor; the others are those of
`mecanum_env.wheel_drive.drive.DriveParameters`, its load and the robot.
"""
CHAIN: Final = (*DYNPRM, "servo_n_m_s_rad", *USER)
"""All of them, in order."""

PROGRAMS: Final = ("command_program", "set_point_program", "load_program")
"""Programs of custom effects (`wheel_drive.program`) behind the parameters, PROGRAM_SIZE numbers each."""

Sets = Mapping[str, FloatArray]
"""Name of a parameter -> its value in each set, shape (sets, 1), so that it broadcasts over runs.

Programs have the shape (sets, PROGRAM_SIZE).
"""


def by_name(rows: FloatArray) -> Sets:
    """Return rows of parameters in the order of `CHAIN`, (sets, P), by name; programs may follow them."""
    full = with_programs(rows)
    programs = np.split(full[:, len(CHAIN) :], len(PROGRAMS), axis=1)
    columns = full[:, : len(CHAIN)].T[:, :, None]
    return dict(zip(CHAIN, columns, strict=True)) | dict(zip(PROGRAMS, programs, strict=True))


def with_programs(rows: FloatArray) -> FloatArray:
    """Return rows of parameters, shape (sets, P), with empty programs behind them where they have none.

    Raises:
        ValueError: they have neither the length of `CHAIN` nor that with programs.
    """
    given, programs = np.asarray(rows, float), len(PROGRAMS) * PROGRAM_SIZE
    if given.ndim != 2 or given.shape[1] not in (len(CHAIN), len(CHAIN) + programs):
        raise ValueError(
            f"parameters of shape {given.shape}, must have {len(CHAIN)} or {programs} more columns"
        )
    if given.shape[1] > len(CHAIN):
        return given
    return np.hstack([given, np.zeros((len(given), programs))])
