"""The second bench's nominal drives, and what may be hidden in one.

Everything is seen from the wheel's shaft: the rotor's inertia times the gear ratio squared, volts per rad/s
of the wheel. A drive's stiffness against load follows from its physics. With the current settled, the
motor's torque on the shaft is N Kt/R (u - N Ke w), and the controller's u falls by Kp per rad/s and by Ki per
rad that the wheel lags, so

    servo = N Kt/R (Kp + N Ke) [N m s/rad]        integral = N Kt/R Ki [N m/rad].
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Drive:
    """A DC motor with inductance, a gear, and a speed controller of 1 kHz with a voltage limit."""

    name: str
    kp_v_s: float
    """Volts per rad/s of wheel speed error."""
    ki_v: float = 0.0
    kd_v_s2: float = 0.0
    feed_forward: bool = False
    """Add the back EMF that the reference will make: no load, no error, without an integral."""
    filters_s: tuple[float, ...] = ()
    """Time constants of first-order filters on the reference, in the firmware."""
    resistance_ohm: float = 1.0
    inductance_h: float = 4e-4
    torque_constant: float = 0.02
    """Kt [N m/A] = Ke [V s/rad], at the motor."""
    gear: float = 20.0
    rotor_kg_m2: float = 3.0e-3
    """At the wheel's shaft."""
    wheel_kg_m2: float = 2.6e-4
    supply_v: float = 24.0

    @property
    def back_emf(self) -> float:
        """Volts per rad/s of the wheel; also N m per ampere on its shaft."""
        return self.gear * self.torque_constant

    @property
    def servo(self) -> float:
        """Torque per lag in speed [N m s/rad]."""
        return self.back_emf / self.resistance_ohm * (self.kp_v_s + self.back_emf)

    @property
    def servo_integral(self) -> float:
        """Torque per lag in angle [N m/rad]."""
        return self.back_emf / self.resistance_ohm * self.ki_v

    def robot(self) -> dict[str, float]:
        """Return the robot section that a ruler, a scale and a spring balance give: a small robot's."""
        return {
            "wheel_radius_m": 0.05,
            "half_wheelbase_m": 0.1,
            "half_track_m": 0.1,
            "mass_kg": 5.0,
            "yaw_inertia_kg_m2": 0.06,
            "servo_n_m_s_rad": self.servo,
            "servo_integral_n_m_rad": self.servo_integral,
        }


DRIVES = {
    drive.name: drive
    for drive in (
        # A fast loop behind a filtered reference; friction leaves a droop.
        Drive("droop", kp_v_s=1.6, feed_forward=True, filters_s=(0.04, 0.02)),
        # The same with an integral: friction leaves none.
        Drive("integral", kp_v_s=1.6, ki_v=25.0, feed_forward=True, filters_s=(0.045, 0.015)),
        # A plain PID that turns a heavy rotor and sees the steps themselves, as in the paper.
        Drive(
            "pid",
            kp_v_s=0.6,
            ki_v=18.0,
            kd_v_s2=4e-4,
            resistance_ohm=1.2,
            inductance_h=1.5e-3,
            torque_constant=0.06,
            rotor_kg_m2=0.068,
            supply_v=72.0,
        ),
    )
}


@dataclass(frozen=True)
class Hidden:
    """What is done to a drive; each field's default is nothing.

    The first part has a counterpart in the catalogue of effects, by other mechanisms; the second has none.
    """

    command_late_s: float = 0.0
    """A queue between receiver and controller."""
    ignored_below_rpm: float = 0.0
    """The receiver treats smaller commands as noise."""
    wrong_ratio: float = 1.0
    """The drive takes its gear for this many times what it is."""
    weak_reverse: float = 1.0
    """The reference of the reverse half-bridge is this many times that of the forward one."""
    supply_fall_per_s: float = 0.0
    """The reference is a share of the supply, which falls by this part of itself each second."""
    top_rpm: float = math.inf
    ramp_rpm_s: float = math.inf
    """Of the controller's reference, at 1 kHz."""
    play_deg: float = 0.0
    """Between the last gear and the wheel."""
    drag_n_m: float = 0.0
    """Coulomb friction of the wheel's bearing."""
    sticking_n_m: float = 0.0
    """Beyond the drag at rest; lost as exp(-(speed/sticking_rpm)^2)."""
    sticking_rpm: float = 5.0
    oil_n_m_s: float = 0.0
    """Viscous friction of the bearing."""
    log_late_s: float = 0.0
    log_filter_s: float = 0.0
    log_factor: float = 1.0

    # Outside the catalogue.
    ripple: float = 0.0
    """An eccentric code wheel: the logged speed is this part too high and too low in each turn."""
    cogging_n_m: float = 0.0
    """Torque on the rotor that goes with its angle, seven times a turn of the wheel."""
    shaking_n_m: float = 0.0
    """A torque that swings at 2.3 Hz."""
    lost_commands: float = 0.0
    """Share of commands that never arrive."""
    rising_gain: float = 0.0
    """Gain over command: 1 + rising_gain |command| / 100 rpm - 0.5 rising_gain."""
    slower_loop: float = 1.0
    """The controller's gains and filters are set this many times slower, with an integral that overshoots."""
    warming: float = 0.0
    """Part of the gain that is lost as 1 - exp(-t / 0.4 s)."""
    glitch_share: float = 0.0
    """Share of logged samples that are wild."""
    hysteresis: float = 0.0
    """Part of the gain that is missing after a command that was smaller in size than the one before."""
    offset_rpm: float = 0.0
    """Added to each command: a reference that is not zeroed."""
    coarse_rpm: float = 0.0
    """The receiver knows only multiples of this."""
    swing: float = 0.0
    """The gain swings by this part at 0.9 Hz."""
