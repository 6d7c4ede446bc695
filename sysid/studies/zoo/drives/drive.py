"""A drive of the zoo as its makers would describe it: motor, gear, wheel, controller, sensor and link.

Every mechanism that a study can hide is a field here, so a changed drive is a drive with other values. All
mechanical quantities are seen from the wheel's shaft: a rotor's inertia is multiplied by the gear ratio
squared, volts are per rad/s of the wheel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

Family = Literal[
    "open_duty",
    "open_duty_compensated",
    "p",
    "pi",
    "pid",
    "cascade",
    "feed_forward",
    "filtered_set_point",
    "profile",
]
"""The topology of a controller; `families.FAMILIES` says what each is and which products have it."""


@dataclass(frozen=True)
class Motor:
    """A DC motor (or a brushless one behind its commutation) with its supply."""

    resistance_ohm: float
    inductance_h: float
    back_emf_v_s: float
    """Volts per rad/s of the wheel; also N m per ampere on the wheel's shaft."""
    inertia_kg_m2: float
    supply_v: float
    """At the start of a run."""
    current_limit_a: float = math.inf
    brake_current_a: float = math.inf
    """Limit while the current brakes the rotor."""
    supply_fall_per_s: float = 0.0
    """Share of the supply that is lost per second."""
    supply_resistance_ohm: float = 0.0
    """The battery's own; the supply falls with the current."""
    winding_warming: float = 0.0
    """Share by which the resistance rises with time, as 1 - exp(-t / warming_s)."""
    warming_s: float = 60.0
    current_fade: float = 0.0
    """Share of both current limits that is lost with time, as 1 - exp(-t / current_fade_s)."""
    current_fade_s: float = 2.0
    supply_swing: float = 0.0
    """Amplitude of a sine on the supply, as a share of it."""
    supply_swing_hz: float = 1.0


@dataclass(frozen=True)
class Gear:
    """The gear and the wheel: frictions on both sides of a play."""

    wheel_inertia_kg_m2: float
    motor_coulomb_n_m: float = 0.0
    motor_viscous_n_m_s: float = 0.0
    wheel_coulomb_n_m: float = 0.0
    wheel_viscous_n_m_s: float = 0.0
    wheel_sticking_n_m: float = 0.0
    """Beyond the Coulomb friction at rest; it falls as exp(-(speed / sticking_rad_s)^2)."""
    sticking_rad_s: float = 0.5
    play_deg: float = 0.0
    play_spring_n_m_rad: float = 0.0
    """Stiffness of an elastic gap (rubber coupling, belt); 0: nothing inside the gap."""
    cogging_n_m: float = 0.0
    """Amplitude of a torque on the wheel that goes with its angle."""
    cogging_per_turn: int = 1
    cogging_phase_deg: float = 0.0
    friction_warming: float = 0.0
    """Share of all friction that is lost with time, as 1 - exp(-t / friction_warming_s)."""
    friction_warming_s: float = 30.0
    drag_n_m_s2: float = 0.0
    """Torque against the wheel per squared rad/s, as a fan makes it."""
    rub_n_m: float = 0.0
    """Coulomb friction on the wheel in the first fifth of every period of `rub_hz`."""
    rub_hz: float = 1.0


@dataclass(frozen=True)
class Controller:
    """The firmware: what it does with a command, its speed loop and its current loop.

    The speed loop computes volts (duty times nominal supply) from rad/s. With `current_kp` above 0 it
    computes amperes, which a faster current loop turns into volts.
    """

    family: Family
    loop_hz: float
    kp: float = 0.0
    """V s (volts per rad/s), or A s with a current loop."""
    ki: float = 0.0
    kd: float = 0.0
    feed_forward: float = 0.0
    """Volts (or amperes) per rad/s of set-point."""
    emf_compensation: float = 0.0
    """Share of the motor's R i drop that an open-loop drive adds (IxR compensation)."""
    supply_compensation: bool = False
    """Whether the duty is divided by the measured supply."""
    nominal_supply_v: float = 0.0
    """Supply for which the firmware turns volts into duty; 0: the motor's at the start of a run."""
    anti_windup: bool = True
    derivative_of_error: bool = False
    """Whether the derivative sees the set-point too, and not only the measured speed."""
    current_kp: float = 0.0
    """V/A; 0: no current loop."""
    current_ki: float = 0.0
    """V/(A s)."""
    encoder_counts: int = 0
    """Counts per turn of the wheel that the loop sees; 0: exact speed (tachometer)."""
    encoder_window_s: float = 0.0
    """Over which the loop counts; at least one tick."""
    speed_filter_s: float = 0.0
    """First-order filter on the measured speed."""

    # The set-point's path, in this order.
    dead_zone_rpm: float = 0.0
    dead_zone: Literal["drop", "subtract"] = "drop"
    quantum_rpm: float = 0.0
    """Resolution of the received command; 0: exact."""
    gain: float = 1.0
    """The drive takes its gear ratio or its wheel for this many times what it is."""
    reverse_gain: float = 1.0
    """Gain of negative commands over that of positive ones."""
    offset_rpm: float = 0.0
    """Added to every command, also to 0: a reference that is not zeroed."""
    curve_rpm: tuple[tuple[float, float], ...] = ()
    """Points (command, set-point) of an odd, monotone curve in the first quadrant; empty: straight."""
    gain_fall_per_s: float = 0.0
    """Share of the set-point that is lost per second (an analogue reference from the battery)."""
    gain_per_volt: float = 0.0
    """Share of the set-point that is lost per volt of battery below the first sample's."""
    gain_warming: float = 0.0
    """Share of the set-point that is lost with time, as 1 - exp(-t / gain_warming_s)."""
    gain_warming_s: float = 30.0
    gain_swing: float = 0.0
    """Amplitude of a sine in time on the set-point, as a share of it."""
    gain_swing_hz: float = 1.0
    gain_hysteresis: float = 0.0
    """Share of the set-point that is missing after a command smaller in size than the one before."""
    ceiling_rpm: float = math.inf
    ceiling_softness_rpm: float = 0.0
    ramp_rpm_s: float = math.inf
    brake_rpm_s: float = 0.0
    """Ramp of a falling speed; 0: the same as rising."""
    jerk_rpm_s2: float = math.inf
    filters_s: tuple[float, ...] = ()
    """First-order filters of the set-point."""
    freeze_share: float = 0.0
    """Share of the time in which the firmware hangs and its last output goes on."""
    freeze_s: float = 0.1
    """How long it hangs."""


@dataclass(frozen=True)
class Sensor:
    """How a wheel's speed reaches the log."""

    sample_s: float
    counts: int = 0
    """Counts per turn of the wheel; 0: a tachometer with `noise_rpm`."""
    side: Literal["wheel", "motor"] = "wheel"
    """Side of the gear's play on which the speed is measured."""
    window_s: float = 0.0
    """Time over which counts are taken; 0: one sample."""
    noise_rpm: float = 0.0
    filter_s: float = 0.0
    late_s: float = 0.0
    scale: float = 1.0
    eccentricity: float = 0.0
    """The logged speed swings by this share with the wheel's angle."""
    eccentricity_per_turn: int = 1
    eccentricity_phase_deg: float = 0.0
    stamps: Literal["even", "uneven", "late"] = "even"
    """Stamps of an even clock; of a jittering one; or stamped on arrival, after a varying delay."""
    jitter_s: float = 0.0
    outlier_share: float = 0.0
    held_share: float = 0.0
    """Share of samples that repeat the one before, because no new value arrived."""
    blank_share: float = 0.0
    """Share of the time in which zero is logged, because the signal is lost."""
    blank_s: float = 0.1
    """How long it is lost, at least one sample."""
    resolution_rpm: float = 0.0
    """Rounding of the logged number."""


@dataclass(frozen=True)
class Link:
    """How commands reach the drive."""

    period_s: float = 0.1
    delay_s: float = 0.0
    jitter_s: float = 0.0
    """Standard deviation of the delay from one change of command to the next; never earlier than sent."""
    loss: float = 0.0
    """Share of commands that never arrive; the last one that did goes on."""


@dataclass(frozen=True)
class Battery:
    """The supply's voltage during a run, where it is logged."""

    logged: bool = False
    full_v: float = 24.0
    fall_v_per_s: float = 0.0


@dataclass(frozen=True)
class Drive:
    """One drive with its wheel off the floor."""

    motor: Motor
    gear: Gear
    controller: Controller
    sensor: Sensor
    link: Link = field(default_factory=Link)
    battery: Battery = field(default_factory=Battery)
    top_rpm: float = 100.0
    """Largest command that its user gives."""

    @property
    def family(self) -> Family:
        """Topology of the controller."""
        return self.controller.family
