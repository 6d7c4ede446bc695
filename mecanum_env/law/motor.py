"""The wheel law of a DC motor under a discrete PID controller, and the motor of a law.

Motor with gear ratio N (motor turns per wheel turn), seen from the wheel speed w: the torque balance
J dW/dt + b W = Kt i and the circuit L di/dt + R i + Ke W = u, with W = N w, give after eliminating i

    u = a2 w'' + a1 w' + a0 w,   a2 = N L J / Kt,   a1 = N (L b + R J) / Kt,   a0 = N (R b / Kt + Ke).

Differences over one period t stand for the derivatives, w' = (w(k+1) - w(k))/t and the centred
w'' = (w(k+1) - 2 w(k) + w(k-1))/t^2:

    u(k) = P w(k+1) + Q w(k) + S w(k-1),   P = a2/t^2 + a1/t,   Q = a0 - 2 a2/t^2 - a1/t,   S = a2/t^2.

The incremental PID with error e = r - w sets

    u(k) - u(k-1) = q0 e(k) + q1 e(k-1) + q2 e(k-2),
    q0 = Kp + Ki t + Kd/t,   q1 = -Kp - 2 Kd/t,   q2 = Kd/t.

Subtract the motor equation at k-1 from that at k, insert the controller and solve for w(k+1):

    A = (P - Q - q0)/P   B = (Q - S - q1)/P   C = (S - q2)/P   D = q0/P   E = q1/P   F = q2/P.

The numerators sum to P: A+B+C+D+E+F = 1 for every motor and gain, hence unit DC gain and five free numbers.
Without inductance a2 = S = 0, which is the reduced-order motor: C = -F, and C = F = 0 if also Kd = 0.

In the other direction a law determines a2, a1, a0 and the three gains up to one common factor, since it holds
no volts. The motor voltage at one steady wheel speed gives that factor; R, Kt and Ke then give L, J and b.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from mecanum_env.errors import InputError
from mecanum_env.law.coefficients import WheelLaw


@dataclass(frozen=True)
class Motor:
    """A DC motor with gear and load in SI units; all but the gear refer to the motor's side.

    Raises:
        InputError: a constant is negative, not finite, or 0 where the motor could not work.
    """

    resistance: float
    """Armature resistance R [ohm], above 0."""
    inductance: float
    """Armature inductance L [H]; 0 gives the reduced-order law."""
    torque_constant: float
    """Kt [N m/A], above 0."""
    back_emf: float
    """Ke [V s/rad]; equals Kt in an ideal motor."""
    inertia: float
    """J of rotor and load [kg m^2], above 0."""
    damping: float
    """Viscous friction b of rotor and load [N m s/rad]."""
    gear: float = 1.0
    """N, motor turns per wheel turn, above 0."""

    def __post_init__(self) -> None:
        positive = ("resistance", "torque_constant", "inertia", "gear")
        _require_positive(**{name: getattr(self, name) for name in positive})
        _require_not_negative(inductance=self.inductance, back_emf=self.back_emf, damping=self.damping)


@dataclass(frozen=True)
class Pid:
    """Gains of the wheel-speed controller, volts per rad/s of *wheel* speed error."""

    Kp: float
    """Proportional gain [V s/rad]."""
    Ki: float
    """Integral gain [V/rad]."""
    Kd: float
    """Derivative gain [V s^2/rad]."""


@dataclass(frozen=True)
class LumpedDrive:
    """The drive as its law determines it: u = a2 w'' + a1 w' + a0 w of wheel speed w [rad/s], and gains.

    The law alone leaves one common factor of all six numbers open.
    """

    a0: float
    """Motor voltage per steady wheel speed [V s/rad]."""
    a1: float
    """Voltage per wheel acceleration [V s^2/rad]."""
    a2: float
    """Voltage per wheel jerk [V s^3/rad]."""
    pid: Pid


def lump(motor: Motor, pid: Pid) -> LumpedDrive:
    """Return the lumped constants of a motor with the controller `pid`."""
    n, kt = motor.gear, motor.torque_constant
    return LumpedDrive(
        a0=n * (motor.resistance * motor.damping / kt + motor.back_emf),
        a1=n * (motor.inductance * motor.damping + motor.resistance * motor.inertia) / kt,
        a2=n * motor.inductance * motor.inertia / kt,
        pid=pid,
    )


def law_from_lumped(drive: LumpedDrive, sample_period_s: float) -> WheelLaw:
    """Return the law of a drive whose controller runs every `sample_period_s` [s]; it may be unstable.

    Raises:
        InputError: the period is not above 0, or a1 and a2 are both 0 (a drive without inertia).
    """
    t, gains = sample_period_s, drive.pid
    if not t > 0.0:
        raise InputError(f"sample_period_s = {t}, must be above 0")
    p = drive.a2 / t**2 + drive.a1 / t
    if p == 0.0:
        raise InputError("a1 = a2 = 0, a drive without inertia has no law; give the inertia")
    q = drive.a0 - 2.0 * drive.a2 / t**2 - drive.a1 / t
    s = drive.a2 / t**2
    q0, q1, q2 = gains.Kp + gains.Ki * t + gains.Kd / t, -gains.Kp - 2.0 * gains.Kd / t, gains.Kd / t
    return WheelLaw((p - q - q0) / p, (q - s - q1) / p, (s - q2) / p, q0 / p, q1 / p, q2 / p, t)


def law_from_drive(motor: Motor, pid: Pid, sample_period_s: float) -> WheelLaw:
    """Return the law of a motor whose controller `pid` runs every `sample_period_s` [s]; it may be unstable.

    Raises:
        InputError: the period is not above 0.
    """
    return law_from_lumped(lump(motor, pid), sample_period_s)


def lumped_from_law(law: WheelLaw, steady_volts_s_rad: float = 1.0) -> LumpedDrive:
    """Return the lumped drive of a law of unit DC gain, scaled so that a0 = `steady_volts_s_rad`.

    That is the motor voltage over wheel speed at steady speed [V s/rad], as a multimeter gives it; 1 leaves
    all six numbers relative to it.

    Raises:
        InputError: the six coefficients do not sum to 1; a0 is not positive, so that no passive motor under
            PID has this law; or `steady_volts_s_rad` is not a finite number above 0.
    """
    total = float(sum(law.coefficients))
    if abs(total - 1.0) > 1e-9:
        raise InputError(
            f"A+B+C+D+E+F = {total:.9g}, must be 1 for a motor under PID; use law.normalised() first"
        )
    _require_positive(steady_volts_s_rad=steady_volts_s_rad)
    t = law.sample_period_s
    s = law.C + law.F
    q = law.B + law.E + s
    a0, a1, a2 = 1.0 + q + s, (1.0 - s) * t, s * t**2  # all in units of P
    if a0 <= 0.0:
        raise InputError(
            f"a0 = {a0:.6g} in units of P, must be above 0; no passive motor under PID has this law"
        )
    scale = steady_volts_s_rad / a0
    pid = Pid(scale * (-law.E - 2.0 * law.F), scale * (law.D + law.E + law.F) / t, scale * law.F * t)
    return LumpedDrive(steady_volts_s_rad, scale * a1, scale * a2, pid)


def drive_from_law(
    law: WheelLaw,
    *,
    resistance: float,
    torque_constant: float,
    back_emf: float,
    steady_volts_s_rad: float,
    gear: float = 1.0,
) -> tuple[Motor, Pid]:
    """Return the motor and controller of a law from constants that a multimeter and a data sheet give.

    The steady voltage gives b = Kt (a0/N - Ke)/R. Eliminating L = Kt a2/(N J) leaves
    R J^2 - (Kt a1/N) J + Kt a2 b/N = 0. Its two roots exchange the electrical and the mechanical time
    constant, L/R and J/b; the larger J is taken, since the electrical side is the faster one.

    The law has unit DC gain. `resistance`, `torque_constant`, `back_emf` and `gear` are those of `Motor`;
    `steady_volts_s_rad` is the motor voltage over *wheel* speed at steady speed without load [V s/rad].

    Raises:
        InputError: as `lumped_from_law`, or no real, passive motor with these constants has this law.
    """
    _require_positive(resistance=resistance, torque_constant=torque_constant, gear=gear)
    _require_not_negative(back_emf=back_emf)
    drive = lumped_from_law(law, steady_volts_s_rad)
    damping = torque_constant * (drive.a0 / gear - back_emf) / resistance
    if damping < -1e-12 * torque_constant * back_emf / resistance:
        raise InputError(
            f"steady_volts_s_rad = {steady_volts_s_rad:g}, must be at least gear * back_emf = "
            f"{gear * back_emf:g}: a motor cannot turn faster than its back EMF allows"
        )
    damping = max(damping, 0.0)
    a1, a2 = torque_constant * drive.a1 / gear, torque_constant * drive.a2 / gear
    discriminant = a1**2 - 4.0 * resistance * a2 * damping
    if a1 <= 0.0 or a2 < -1e-12 * a1 * law.sample_period_s or discriminant < 0.0:
        raise InputError(
            f"no real motor with these constants has this law (a1 = {drive.a1:.6g}, a2 = {drive.a2:.6g}, "
            f"discriminant {discriminant:.6g}): its inertia and inductance would be negative or complex; "
            "check resistance, torque_constant, back_emf and steady_volts_s_rad"
        )
    inertia = (a1 + math.sqrt(discriminant)) / (2.0 * resistance)
    inductance = max(a2, 0.0) / inertia
    return Motor(resistance, inductance, torque_constant, back_emf, inertia, damping, gear), drive.pid


def _require_positive(**constants: float) -> None:
    for name, value in constants.items():
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(f"{name} = {value}, must be a finite number above 0")


def _require_not_negative(**constants: float) -> None:
    for name, value in constants.items():
        if not (math.isfinite(value) and value >= 0.0):
            raise InputError(f"{name} = {value}, must be a finite number, 0 or above")
