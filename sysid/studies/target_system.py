"""A wheel drive outside the model class of every method, which stands in for a real one.

A continuous DC motor with inductance, gear friction and a voltage limit, under a discrete PID that sees only
a counting encoder:

    L di/dt = u - R i - Ke w        J dw/dt = Kt i - b w - friction        (w at the motor, before the gear)
    u = clip(Kp e + Ki sum(e) t + Kd (e - e_before)/t, +-u_max)            every control period t

(motor equations: Kuczmann, Electronics 13(11):2225, 2024). The constants are this project's: a 24 V geared
motor of common size, the PID tuned so that the drive behaves as the published robot does: rise (10-90 %)
about 0.11 s, settling (2 %) about 0.25 s, relative steady-state error 4.5e-4 on average, no faster than
135 rpm. `tests/studies/test_target_system.py` holds it to these numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm

from mecanum_env.errors import InputError
from mecanum_env.units import RAD_S_PER_RPM, FloatArray


@dataclass(frozen=True)
class TargetSystem:
    """Constants of motor, gear, encoder and controller."""

    resistance_ohm: float = 1.2
    inductance_h: float = 1.5e-3
    torque_constant_n_m_a: float = 0.06
    """Also the back-EMF constant [V s/rad], as energy conservation has it."""
    inertia_kg_m2: float = 1.7e-4
    """Inertia of rotor, gear and wheel, at the motor."""
    damping_n_m_s_rad: float = 2.0e-5
    friction_n_m: float = 0.012
    """Coulomb friction of the gear, at the motor."""
    gear_ratio: float = 20.0
    supply_v: float = 24.0
    """The voltage limit. At 135 rpm the motor needs about 17 V."""
    encoder_counts: int = 2048
    """Counts per turn of the motor (512 lines, quadrature)."""
    ceiling_rpm: float = 135.0
    """The drive clips commands to this speed."""
    command_quantum_rpm: float = 1.0
    command_period_s: float = 0.1
    control_period_s: float = 0.001
    speed_window: int = 5
    """Number of control periods over which the drive counts pulses to measure its speed."""
    clock_error: float = 4.5e-4
    """The drive's clock is this much fast, so the wheel runs this much faster than commanded: the
    steady-state error of the published robot. Ceramic resonators are within 5e-3."""
    kp_v_s_rad: float = 0.0894
    ki_v_rad: float = 1.258
    kd_v_s2_rad: float = 2.0e-5


@dataclass(frozen=True, eq=False)
class TargetRecord:
    """What a host logs of one run, and what it cannot see."""

    time_s: FloatArray
    """Shape (n,), from 0."""
    command_rpm: FloatArray
    """As sent, before rounding and ceiling; shape (n,)."""
    speed_rpm: FloatArray
    """Counted over the sample interval that ends here, with noise; shape (n,)."""
    true_speed_rpm: FloatArray
    """The wheel's own speed at this instant; shape (n,)."""


def simulate_target(
    command_rpm: npt.ArrayLike,
    *,
    rng: np.random.Generator,
    system: TargetSystem | None = None,
    noise_rpm: float = 0.5,
    sample_period_s: float = 0.01,
) -> TargetRecord:
    """Run the drive from rest and log it.

    Args:
        command_rpm: One command per `command_period_s`, shape (m,); the run lasts m command periods.
        rng: Random generator of the encoder's initial phase and the noise.
        system: The drive; None: the default one.
        noise_rpm: Standard deviation of the white noise on the logged speed [rpm].
        sample_period_s: Sample period of the log; a multiple of the control period [s].

    Raises:
        InputError: no commands, or a sample period that is no multiple of the control period.
    """
    drive = TargetSystem() if system is None else system
    commands = np.atleast_1d(np.asarray(command_rpm, float))
    per_sample = _whole(sample_period_s / drive.control_period_s, "sample_period_s")
    per_command = _whole(drive.command_period_s / drive.control_period_s, "command_period_s")
    if commands.size == 0:
        raise InputError("command_rpm is empty; give one command per command period")
    ticks = per_command * commands.size
    angle, speed = _simulate_motor(drive, commands, per_command, float(rng.uniform(0.0, 2.0 * math.pi)))
    rows = np.arange(0, ticks + 1, per_sample)
    counts = np.floor(angle[rows] * (drive.encoder_counts / (2.0 * math.pi)))
    rpm_per_count = 60.0 / (drive.encoder_counts * drive.gear_ratio * sample_period_s)
    counted = np.concatenate([[0.0], np.diff(counts)]) * rpm_per_count
    return TargetRecord(
        time_s=np.asarray(rows * drive.control_period_s, float),
        command_rpm=commands[np.minimum(rows // per_command, commands.size - 1)],
        speed_rpm=counted + noise_rpm * rng.standard_normal(rows.size),
        true_speed_rpm=speed[rows] / (drive.gear_ratio * RAD_S_PER_RPM),
    )


def _whole(ratio: float, name: str) -> int:
    if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-6:
        raise InputError(f"{name} is {ratio:g} control periods, must be a whole number of them, at least 1")
    return round(ratio)


def _simulate_motor(
    drive: TargetSystem, commands: FloatArray, per_command: int, start_angle: float
) -> tuple[FloatArray, FloatArray]:
    """Return motor angle [rad] and speed [rad/s] at every control tick, shapes (ticks + 1,)."""
    substeps = 2
    step = drive.control_period_s / substeps
    (a_ii, a_iw, b_iu, b_if), (a_wi, a_ww, b_wu, b_wf) = _transition(drive, step)
    decay = math.exp(-drive.resistance_ohm / drive.inductance_h * step)
    kt, friction = drive.torque_constant_n_m_a, drive.friction_n_m
    to_counts = drive.encoder_counts / (2.0 * math.pi)
    # The clock error makes the drive's assumed window differ from the true one.
    seen_window = drive.speed_window * drive.control_period_s * (1.0 + drive.clock_error)
    rad_s_per_count = 1.0 / (to_counts * seen_window)
    quantum = drive.command_quantum_rpm
    latched = np.rint(commands / quantum) * quantum if quantum > 0.0 else commands
    latched = np.clip(latched, -drive.ceiling_rpm, drive.ceiling_rpm) * (drive.gear_ratio * RAD_S_PER_RPM)
    ticks = per_command * commands.size
    angles, speeds = np.empty(ticks + 1), np.empty(ticks + 1)
    current = speed = integral = before = 0.0
    angle = angles[0] = start_angle
    speeds[0] = 0.0
    history = [math.floor(angle * to_counts)] * (drive.speed_window + 1)
    for tick in range(ticks):
        error = float(latched[tick // per_command]) - (history[-1] - history[0]) * rad_s_per_count
        wanted = (
            drive.kp_v_s_rad * error
            + integral
            + drive.ki_v_rad * error * drive.control_period_s
            + drive.kd_v_s2_rad * (error - before) / drive.control_period_s
        )
        voltage = min(max(wanted, -drive.supply_v), drive.supply_v)
        if voltage == wanted or (wanted > voltage) != (error > 0.0):  # anti-windup: hold while limited
            integral += drive.ki_v_rad * error * drive.control_period_s
        before = error
        for _ in range(substeps):
            if speed == 0.0 and abs(kt * current) <= friction:  # sticks
                current = decay * current + (1.0 - decay) * voltage / drive.resistance_ohm
                continue
            drag = math.copysign(friction, speed if speed != 0.0 else current)
            after = a_wi * current + a_ww * speed + b_wu * voltage - b_wf * drag
            current = a_ii * current + a_iw * speed + b_iu * voltage - b_if * drag
            if speed * after < 0.0:  # friction stops a wheel, it does not turn it
                after = 0.0
            angle += 0.5 * (speed + after) * step
            speed = after
        history = [*history[1:], math.floor(angle * to_counts)]
        angles[tick + 1], speeds[tick + 1] = angle, speed
    return angles, speeds


def _transition(drive: TargetSystem, step: float) -> list[list[float]]:
    """Return the exact transition of (current, speed) over one step, columns (i, w, voltage, torque)."""
    kt, inductance, inertia = drive.torque_constant_n_m_a, drive.inductance_h, drive.inertia_kg_m2
    generator = np.zeros((4, 4))
    generator[0] = [-drive.resistance_ohm / inductance, -kt / inductance, 1.0 / inductance, 0.0]
    generator[1] = [kt / inertia, -drive.damping_n_m_s_rad / inertia, 0.0, 1.0 / inertia]
    rows: list[list[float]] = expm(generator * step)[:2].tolist()
    return rows
