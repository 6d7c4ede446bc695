"""Controllers tuned as their users would: a clock, an encoder, and gains for a bandwidth and a phase margin.

The plant from volts to rad/s is taken as 1/k / (T s + 1), from amperes as k / (J s), each with the
loop's own delay.
A PI controller kp (1 + a/s) has the crossover W where

    kp sqrt(1 + (a/W)^2) |plant(j W)| = 1,      margin = pi - atan(a/W) - lag of the plant and the delay at W.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from sysid.studies.zoo.drives.drive import Controller, Family
from sysid.studies.zoo.drives.kernel import RING_LENGTH
from sysid.studies.zoo.drives.plant import Plant, draw_counts, log_uniform, sometimes, window_for

_LONGEST_WINDOW_S = 0.05
_SLOWEST, _FASTEST = 4.0, 120.0
"""Range of the wanted crossovers [rad/s]."""
_DELAY_RAD = 0.5
"""Largest phase that the loop's delay may cost at the crossover."""


@dataclass(frozen=True)
class _Gains:
    kp: float
    ki: float
    crossover: float


def draw_controller(rng: np.random.Generator, family: Family, plant: Plant) -> Controller:
    """Return a controller of a family, tuned to a plant; not each one is stable."""
    if family in ("open_duty", "open_duty_compensated"):
        return _open_loop(rng, family, plant)
    loop = _draw_loop(rng, family, plant)
    if family == "p":
        return _proportional(rng, loop, plant)
    in_amperes = family == "cascade" or (family in ("filtered_set_point", "profile") and rng.random() < 0.5)
    if in_amperes:
        loop = _with_current_loop(rng, loop, plant)
    gains = _pi(rng, loop, plant)
    control = replace(loop, kp=gains.kp, ki=gains.ki, anti_windup=bool(rng.random() < 0.7))
    if family == "pid":
        return replace(
            control,
            kd=gains.kp * log_uniform(rng, 0.02, 0.3) / gains.crossover,
            derivative_of_error=bool(rng.random() < 0.4),
        )
    if family == "feed_forward":
        return replace(control, feed_forward=plant.motor.back_emf_v_s * rng.uniform(0.85, 1.1))
    if family == "filtered_set_point":
        count = int(rng.integers(1, 3))
        return replace(control, filters_s=tuple(log_uniform(rng, 0.008, 0.25) for _ in range(count)))
    if family == "profile":
        ramp = plant.top_rpm / log_uniform(rng, 0.08, 1.5)
        smooth = rng.random() < 0.5
        return replace(
            control,
            ramp_rpm_s=ramp,
            brake_rpm_s=sometimes(rng, 0.4, 0.5, 2.0) * ramp,
            jerk_rpm_s2=ramp / log_uniform(rng, 0.02, 0.3) if smooth else math.inf,
        )
    return control


def _open_loop(rng: np.random.Generator, family: Family, plant: Plant) -> Controller:
    """Draw a drive that turns a command into a duty and looks at no speed."""
    compensated = family == "open_duty_compensated"
    return Controller(
        family,
        loop_hz=log_uniform(rng, 50.0, 5000.0),
        feed_forward=plant.motor.back_emf_v_s * rng.uniform(0.9, 1.1),
        emf_compensation=rng.uniform(0.3, 0.85) if compensated else 0.0,
        speed_filter_s=log_uniform(rng, 0.002, 0.02) if compensated else 0.0,
        supply_compensation=bool(rng.random() < 0.2),
        # Duty in 8 bits or in percent.
        quantum_rpm=float(rng.choice([0.0, 1.0 / 255.0, 1.0 / 100.0])) * plant.top_rpm,
        filters_s=_small_filter(rng),
    )


def _small_filter(rng: np.random.Generator) -> tuple[float, ...]:
    """Draw the filter of the set-point that some firmwares of any topology have."""
    lag_s = sometimes(rng, 0.2, 0.003, 0.05)
    return (lag_s,) if lag_s else ()


def _draw_loop(rng: np.random.Generator, family: Family, plant: Plant) -> Controller:
    """Draw the clock, the encoder and the filters of a controller without gains."""
    loop_hz = log_uniform(rng, 50.0, 5000.0)
    tick_s = 1.0 / loop_hz
    longest_s = max(min(_LONGEST_WINDOW_S, RING_LENGTH * tick_s), tick_s)
    counts = draw_counts(rng, plant.top_rpm, longest_s)
    tachometer = rng.random() < 0.12
    top = plant.top_rpm
    return Controller(
        family,
        loop_hz=loop_hz,
        encoder_counts=0 if tachometer else counts,
        encoder_window_s=window_for(rng, counts, top, tick_s, longest_s),
        speed_filter_s=sometimes(rng, 0.4, 1.0, 8.0) * min(tick_s, 0.005),
        supply_compensation=bool(rng.random() < 0.2),
        quantum_rpm=float(rng.choice([0.0, 0.0, 0.1, 1.0, top / 127.0])),
        filters_s=_small_filter(rng),
    )


def _delay_s(loop: Controller, plant: Plant) -> float:
    """Half a tick of holding, one of computing, half the encoder's window, the filter, the current's lag."""
    tick_s = 1.0 / loop.loop_hz
    window_s = max(loop.encoder_window_s, tick_s) if loop.encoder_counts else 0.0
    inside_s = plant.motor.inductance_h / loop.current_kp if loop.current_kp > 0.0 else plant.lag_s
    return 1.5 * tick_s + window_s / 2.0 + loop.speed_filter_s + inside_s


def _draw_crossover(rng: np.random.Generator, delay_s: float) -> float:
    """Draw a crossover [rad/s] that the delay allows."""
    return log_uniform(rng, min(_SLOWEST, 0.5 * _DELAY_RAD / delay_s), min(_FASTEST, _DELAY_RAD / delay_s))


def _proportional(rng: np.random.Generator, loop: Controller, plant: Plant) -> Controller:
    """Tune a P controller: stiff enough to reach its speed, or with a feed-forward."""
    k, constant_s = plant.motor.back_emf_v_s, plant.time_constant_s
    largest = _DELAY_RAD / _delay_s(loop, plant) * constant_s
    if largest > 3.0 and rng.random() < 0.4:
        return replace(loop, kp=k * log_uniform(rng, 2.8, min(largest, 30.0)))
    stiffness = log_uniform(rng, 0.05 * min(largest, 10.0), min(largest, 10.0))
    return replace(loop, kp=k * stiffness, feed_forward=k * rng.uniform(0.85, 1.0))


def _with_current_loop(rng: np.random.Generator, loop: Controller, plant: Plant) -> Controller:
    """Tune a current loop by cancelling the winding's pole; the speed loop's output becomes amperes."""
    bandwidth = 2.0 * math.pi * log_uniform(rng, 80.0, 1000.0)
    motor = plant.motor
    return replace(
        loop, current_kp=motor.inductance_h * bandwidth, current_ki=motor.resistance_ohm * bandwidth
    )


def _pi(rng: np.random.Generator, loop: Controller, plant: Plant) -> _Gains:
    """Tune a PI speed loop for a drawn crossover and phase margin."""
    delay_s = _delay_s(loop, plant)
    crossover = _draw_crossover(rng, delay_s)
    k = plant.motor.back_emf_v_s
    if loop.current_kp > 0.0:
        inertia = plant.motor.inertia_kg_m2 + plant.gear.wheel_inertia_kg_m2
        inverse, lag = inertia * crossover / k, math.pi / 2.0
    else:
        inverse = k * math.hypot(1.0, plant.time_constant_s * crossover)
        lag = math.atan(plant.time_constant_s * crossover)
    margin = math.radians(rng.uniform(40.0, 85.0))
    spare = math.pi - margin - lag - crossover * delay_s
    corner = crossover * math.tan(min(max(spare, 0.03) * rng.uniform(0.4, 1.0), math.radians(80.0)))
    kp = inverse / math.hypot(1.0, corner / crossover)
    return _Gains(kp, corner * kp, crossover)
