"""The mechanics and the sensors of drives drawn at random: what is there before a controller is tuned."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sysid.studies.zoo.drives.drive import Battery, Gear, Link, Motor, Sensor

_RAD_S = 2.0 * math.pi / 60.0
_SUPPLIES_V = (6.0, 7.4, 12.0, 12.0, 18.5, 24.0, 24.0, 36.0, 48.0)
_USUAL_SAMPLES_S = (0.005, 0.01, 0.02, 0.025, 0.04, 0.05)
_USUAL_PERIODS_S = (0.01, 0.02, 0.025, 0.04, 0.05, 0.1)
_LARGEST_QUANTUM = 0.1
"""Share of the top speed that the counts of a window should tell from rest."""
_LONGEST_WINDOW_S = 0.15


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a number between `low` and `high` whose logarithm is uniform."""
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def sometimes(rng: np.random.Generator, share: float, low: float, high: float) -> float:
    """Return 0, or with a probability of `share` a log-uniform number from `low` to `high`."""
    value = log_uniform(rng, low, high)
    return value if rng.random() < share else 0.0


@dataclass(frozen=True)
class Plant:
    """A motor with its gear and wheel, and the two numbers by which a controller is tuned to it."""

    motor: Motor
    gear: Gear
    top_rpm: float

    @property
    def time_constant_s(self) -> float:
        """Mechanical time constant J R / k^2 of the motor with its wheel at constant volts."""
        inertia = self.motor.inertia_kg_m2 + self.gear.wheel_inertia_kg_m2
        return inertia * self.motor.resistance_ohm / self.motor.back_emf_v_s**2

    @property
    def lag_s(self) -> float:
        """Electrical time constant L / R."""
        return self.motor.inductance_h / self.motor.resistance_ohm


def draw_plant(rng: np.random.Generator) -> Plant:
    """Draw motor, gear and wheel: from gearmotors of 6 V and a tenth of a N m to servo motors of 48 V."""
    top_rpm = log_uniform(rng, 40.0, 400.0)
    size = rng.random()
    # Larger motors have higher supplies, with exceptions.
    place = np.clip(size + rng.normal(0.0, 0.15), 0.0, 0.999)
    supply_v = _SUPPLIES_V[int(place * len(_SUPPLIES_V))]
    stall_n_m = 0.1 * 200.0**size * log_uniform(rng, 0.5, 2.0)
    k = supply_v / (rng.uniform(1.15, 1.8) * top_rpm * _RAD_S)
    resistance = k * supply_v / stall_n_m
    damping = k**2 / resistance
    inertia = log_uniform(rng, 0.01, 0.25) * damping
    at_wheel = log_uniform(rng, 0.02, 0.7)
    friction_n_m = stall_n_m * log_uniform(rng, 0.002, 0.12)
    behind_gear = rng.uniform(0.1, 0.9)
    viscous = damping * log_uniform(rng, 0.002, 0.1)
    limited = sometimes(rng, 0.4, 0.35, 1.0)
    motor = Motor(
        resistance_ohm=resistance,
        inductance_h=resistance * log_uniform(rng, 1e-4, 5e-3),
        back_emf_v_s=k,
        inertia_kg_m2=inertia * (1.0 - at_wheel),
        supply_v=supply_v,
        current_limit_a=limited * supply_v / resistance if limited else math.inf,
        supply_resistance_ohm=resistance * log_uniform(rng, 0.002, 0.1),
    )
    gear = Gear(
        wheel_inertia_kg_m2=inertia * at_wheel,
        motor_coulomb_n_m=friction_n_m * (1.0 - behind_gear),
        motor_viscous_n_m_s=viscous * (1.0 - behind_gear),
        wheel_coulomb_n_m=friction_n_m * behind_gear,
        wheel_viscous_n_m_s=viscous * behind_gear,
        wheel_sticking_n_m=sometimes(rng, 0.5, 0.05, 1.0) * friction_n_m * behind_gear,
        sticking_rad_s=log_uniform(rng, 0.002, 0.05) * top_rpm * _RAD_S,
        play_deg=sometimes(rng, 0.5, 0.05, 3.0),
        cogging_n_m=sometimes(rng, 0.3, 0.02, 0.5) * friction_n_m,
        cogging_per_turn=int(rng.integers(1, 40)),
        cogging_phase_deg=rng.uniform(0.0, 360.0),
    )
    return Plant(motor, gear, top_rpm)


def window_for(
    rng: np.random.Generator, counts: int, top_rpm: float, shortest_s: float, longest_s: float
) -> float:
    """Draw the time [s] over which an encoder is counted, from `shortest_s` to `longest_s`.

    An encoder of few `counts` per turn gets a window that tells about a tenth of the top speed from rest.
    """
    needed_s = 60.0 / (counts * _LARGEST_QUANTUM * top_rpm)
    return float(np.clip(needed_s * log_uniform(rng, 0.5, 5.0), shortest_s, longest_s))


def draw_counts(rng: np.random.Generator, top_rpm: float, longest_window_s: float) -> int:
    """Draw the counts per wheel turn of an encoder that a window of `longest_window_s` makes usable."""
    fewest = max(12.0, 60.0 / (longest_window_s * _LARGEST_QUANTUM * top_rpm))
    return round(log_uniform(rng, fewest, 20000.0))


def _usual(rng: np.random.Generator, value: float, usual: tuple[float, ...]) -> float:
    """Return mostly the usual value that is nearest by ratio, else the value itself."""
    nearest = min(usual, key=lambda other: abs(math.log(other / value)))
    return nearest if rng.random() < 0.7 else value


def draw_sensor(rng: np.random.Generator, top_rpm: float, loop_counts: int) -> Sensor:
    """Draw the sensor of the log: mostly the loop's own encoder (`loop_counts` above 0), or another one."""
    sample_s = _usual(rng, log_uniform(rng, 1.0 / 200.0, 1.0 / 20.0), _USUAL_SAMPLES_S)
    own = rng.random() < 0.6
    tachometer = rng.random() < 0.3
    counts = draw_counts(rng, top_rpm, _LONGEST_WINDOW_S)
    if own and loop_counts:
        counts, tachometer = loop_counts, False
    stamps = rng.choice(np.array(["even", "even", "uneven", "late"]))
    window_s = window_for(rng, counts, top_rpm, min(sample_s, 0.005), _LONGEST_WINDOW_S)
    return Sensor(
        sample_s=sample_s,
        counts=0 if tachometer else counts,
        side="motor" if own and loop_counts else "wheel",
        window_s=0.0 if tachometer else window_s,
        noise_rpm=log_uniform(rng, 0.0005, 0.02) * top_rpm if tachometer else 0.0,
        filter_s=sometimes(rng, 0.4, 0.002, 0.05),
        late_s=sometimes(rng, 0.4, 0.001, 0.03),
        eccentricity=sometimes(rng, 0.3, 0.0005, 0.01),
        eccentricity_per_turn=int(rng.integers(1, 3)),
        eccentricity_phase_deg=rng.uniform(0.0, 360.0),
        stamps=stamps.item(),
        jitter_s=0.0 if stamps == "even" else log_uniform(rng, 0.005, 0.2) * sample_s,
        resolution_rpm=float(rng.choice([0.0, 0.01, 0.1, 1.0])),
    )


def draw_link(rng: np.random.Generator) -> Link:
    """Draw how commands arrive; a nominal link loses few or none."""
    return Link(
        period_s=_usual(rng, log_uniform(rng, 0.01, 0.1), _USUAL_PERIODS_S),
        delay_s=sometimes(rng, 0.6, 0.001, 0.08),
        jitter_s=sometimes(rng, 0.3, 0.0003, 0.005),
        loss=sometimes(rng, 0.15, 0.0005, 0.005),
    )


def draw_battery(rng: np.random.Generator, supply_v: float) -> Battery:
    """Draw whether the supply's voltage, `supply_v` when full, is logged."""
    return Battery(logged=bool(rng.random() < 0.3), full_v=supply_v)
