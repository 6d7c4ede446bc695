"""The torque of a custom load on wheels: the reference for custom_torque in mecanum_env/plugin/chain.c."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from mecanum_env.wheel_drive.program import evaluate_sets

_STILL: Final = 1e-9
"""Difference of speeds [rad/s] that is none."""
_ROOT_STEPS: Final = 12
"""Steps of the search for the speed at which a steep load and the drive agree."""


def custom_torque(
    programs: FloatArray,
    now: Mapping[str, npt.ArrayLike],
    servo_n_m_s_rad: FloatArray,
    per_torque: FloatArray,
    speed: FloatArray,
    drive: FloatArray,
) -> FloatArray:
    """Return the servo's stiffness times the speed that a custom load gives [N m], shape (sets, runs).

    A load that falls steeply with speed is that of the speed at the end of the substep, searched between the
    start and the end that the plain load leads to (regula falsi, Illinois variant).

    Args:
        programs: program of each set, shape (sets, n).
        now: command, angle, time and voltage, in the units of `mecanum_env.wheel_drive.program`.
        servo_n_m_s_rad: stiffness of each set, shape (sets, 1).
        per_torque: change of a wheel's speed in the substep by a torque [rad/s per N m], shape (sets, 1).
        speed: of the wheels at the start of the substep [rad/s], shape (sets, runs).
        drive: torque of the drives [N m], shape (sets, runs).
    """

    def load_at(speeds: FloatArray) -> FloatArray:
        return evaluate_sets(programs, {**now, "speed": speeds / RAD_S_PER_RPM}) * RAD_S_PER_RPM

    alone, gain = speed + per_torque * drive, per_torque * servo_n_m_s_rad
    low, load = speed, load_at(speed)
    high = alone + gain * load
    at_low, at_high = high - low, alone + gain * load_at(high) - high
    plain = servo_n_m_s_rad * load
    steep = (at_low * at_high < 0) & (np.abs(at_high) > np.maximum(0.5 * np.abs(at_low), _STILL))
    going = steep
    for _ in range(_ROOT_STEPS):
        if not np.any(going):
            break
        slope = np.where(going, at_high - at_low, 1.0)
        tried = np.where(going, high - at_high * (high - low) / slope, high)
        here = np.where(going, alone + gain * load_at(tried) - tried, at_high)
        crossed = going & (here * at_high < 0)
        low = np.where(crossed, high, low)
        at_low = np.where(crossed, at_high, np.where(going, at_low * 0.5, at_low))
        high, at_high = tried, here
        going = going & (np.abs(here) > _STILL)
    return np.where(steep, servo_n_m_s_rad * (high - alone) / gain, plain)
