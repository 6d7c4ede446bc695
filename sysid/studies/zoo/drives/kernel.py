"""The equations of one drive as compiled functions: a tick of its firmware and a step of its physics.

All mechanical quantities are seen from the wheel's shaft. With the current i, motor speed wm, wheel speed w
and k = `back_emf_v_s`:

    L di/dt = u - R i - k wm
    Jm dwm/dt = k i - friction_m(wm) - contact
    Jw dw/dt = contact + load + cogging(angle) - friction_w(w)

The current is stepped by its exact exponential, friction by an impulse that stops and never turns a body, and
the play is a contact: the two sides touch and move as one body, or each moves alone. The controller reads an
encoder on the motor's shaft.

A caller keeps one parameter vector (`pack`) and one state vector (`new_state`) per drive, calls
`controller_tick` every `p[TICK_S]` and `plant_substep` as often as it likes in between.
"""

from __future__ import annotations

import math

import numpy as np

from sysid.studies.zoo.drives.arrays import FloatArray, compiled
from sysid.studies.zoo.drives.drive import Drive

RING_LENGTH = 512
"""Largest number of ticks in the controller's encoder window."""

# Indices of the state vector. Angles in rad, speeds in rad/s, all at the wheel's shaft.
(
    WHEEL_ANGLE,
    WHEEL_SPEED,
    MOTOR_SPEED,
    GAP,  # angle of the motor's side less that of the wheel's, within +- half the play
    CONTACT,  # 1 or -1: the side of the gap at which the two touch; 0: they do not
    CURRENT,  # A
    SUPPLY,  # V, as it is now
    VOLTS,  # V at the motor, mean of the last step
    OUTPUT,  # of the last tick: V, or A with a current loop
    SPEED_INTEGRAL,  # V or A
    CURRENT_INTEGRAL,  # V
    MEASURED_SPEED,  # as the controller sees it, filtered
    DERIVED,  # what the derivative saw last
    MEASURED_CURRENT,
    LOAD_SLOPE,  # N m s, set by the caller: the load falls by this per rad/s that the wheel gains in a step
    RING_AT,
    RING,  # from here on: the encoder's counts at the last ticks
) = range(17)
STATE = RING + RING_LENGTH
"""Length of the state vector."""

# Indices of the parameter vector: units as in `drive.Drive`.
(
    RESISTANCE,
    INDUCTANCE,
    BACK_EMF,
    MOTOR_INERTIA,
    SUPPLY_V,
    SUPPLY_FALL,
    SUPPLY_FALL_V,
    SUPPLY_RESISTANCE,
    CURRENT_LIMIT,
    BRAKE_CURRENT,
    WINDING_WARMING,
    WINDING_WARMING_S,
    WHEEL_INERTIA,
    MOTOR_COULOMB,
    MOTOR_VISCOUS,
    WHEEL_COULOMB,
    WHEEL_VISCOUS,
    WHEEL_STICKING,
    STICKING_SPEED,
    HALF_PLAY,
    PLAY_SPRING,
    COGGING,
    COGGING_PER_TURN,
    COGGING_PHASE,
    FRICTION_WARMING,
    FRICTION_WARMING_S,
    TICK_S,
    KP,
    KI,
    KD,
    DERIVATIVE_OF_ERROR,
    FEED_FORWARD,
    COMPENSATION,  # V per measured ampere
    NOMINAL_SUPPLY,
    SUPPLY_COMPENSATION,
    ANTI_WINDUP,
    CURRENT_KP,
    CURRENT_KI,
    ENCODER_COUNTS,
    ENCODER_TICKS,
    FILTER_SHARE,
    CURRENT_FADE,
    CURRENT_FADE_S,
    SUPPLY_SWING,
    SUPPLY_SWING_RAD_S,
    DRAG,
    RUB,
    RUB_HZ,
) = range(48)
PARAMETERS = RUB_HZ + 1
"""Length of the parameter vector."""


def pack(drive: Drive) -> FloatArray:
    """Return the drive's parameter vector, (PARAMETERS,).

    Raises:
        ValueError: The controller's encoder window has more than `RING_LENGTH` ticks.
    """
    motor, gear, control = drive.motor, drive.gear, drive.controller
    ticks = max(1, round(control.encoder_window_s * control.loop_hz))
    if ticks > RING_LENGTH:
        raise ValueError(f"an encoder window of {ticks} ticks; at most {RING_LENGTH} are possible")
    tick_s = 1.0 / control.loop_hz
    p = np.zeros(PARAMETERS)
    p[RESISTANCE] = motor.resistance_ohm
    p[INDUCTANCE] = motor.inductance_h
    p[BACK_EMF] = motor.back_emf_v_s
    p[MOTOR_INERTIA] = motor.inertia_kg_m2
    p[SUPPLY_V] = motor.supply_v
    p[SUPPLY_FALL] = motor.supply_fall_per_s
    p[SUPPLY_FALL_V] = drive.battery.fall_v_per_s * motor.supply_v / drive.battery.full_v
    p[SUPPLY_RESISTANCE] = motor.supply_resistance_ohm
    p[CURRENT_LIMIT] = motor.current_limit_a
    p[BRAKE_CURRENT] = min(motor.brake_current_a, motor.current_limit_a)
    p[WINDING_WARMING] = motor.winding_warming
    p[WINDING_WARMING_S] = motor.warming_s
    p[CURRENT_FADE], p[CURRENT_FADE_S] = motor.current_fade, motor.current_fade_s
    p[SUPPLY_SWING], p[SUPPLY_SWING_RAD_S] = motor.supply_swing, 2.0 * math.pi * motor.supply_swing_hz
    p[WHEEL_INERTIA] = gear.wheel_inertia_kg_m2
    p[MOTOR_COULOMB] = gear.motor_coulomb_n_m
    p[MOTOR_VISCOUS] = gear.motor_viscous_n_m_s
    p[WHEEL_COULOMB] = gear.wheel_coulomb_n_m
    p[WHEEL_VISCOUS] = gear.wheel_viscous_n_m_s
    p[WHEEL_STICKING] = gear.wheel_sticking_n_m
    p[STICKING_SPEED] = gear.sticking_rad_s
    p[HALF_PLAY] = math.radians(gear.play_deg) / 2.0
    p[PLAY_SPRING] = gear.play_spring_n_m_rad
    p[COGGING] = gear.cogging_n_m
    p[COGGING_PER_TURN] = gear.cogging_per_turn
    p[COGGING_PHASE] = math.radians(gear.cogging_phase_deg)
    p[FRICTION_WARMING] = gear.friction_warming
    p[FRICTION_WARMING_S] = gear.friction_warming_s
    p[DRAG] = gear.drag_n_m_s2
    p[RUB], p[RUB_HZ] = gear.rub_n_m, gear.rub_hz
    p[TICK_S] = tick_s
    p[KP], p[KI], p[KD] = control.kp, control.ki, control.kd
    p[DERIVATIVE_OF_ERROR] = control.derivative_of_error
    p[FEED_FORWARD] = control.feed_forward
    p[COMPENSATION] = control.emf_compensation * motor.resistance_ohm
    p[NOMINAL_SUPPLY] = control.nominal_supply_v or motor.supply_v
    p[SUPPLY_COMPENSATION] = control.supply_compensation
    p[ANTI_WINDUP] = control.anti_windup
    p[CURRENT_KP], p[CURRENT_KI] = control.current_kp, control.current_ki
    p[ENCODER_COUNTS] = control.encoder_counts
    p[ENCODER_TICKS] = ticks
    p[FILTER_SHARE] = -math.expm1(-tick_s / control.speed_filter_s) if control.speed_filter_s > 0.0 else 1.0
    return p


def new_state(p: FloatArray, wheel_angle_rad: float = 0.0, gap_share: float = 0.0) -> FloatArray:
    """Return the state of a drive at rest, (STATE,).

    `p` is its parameter vector, `gap_share` from -1 to 1 the place of the motor's side within the play;
    a spring in the play is at rest in its middle.
    """
    state = np.zeros(STATE)
    state[WHEEL_ANGLE] = wheel_angle_rad
    state[GAP] = gap_share * p[HALF_PLAY] if p[PLAY_SPRING] == 0.0 else 0.0
    state[SUPPLY] = p[SUPPLY_V]
    state[RING:] = math.floor((wheel_angle_rad + state[GAP]) * p[ENCODER_COUNTS] / (2.0 * math.pi))
    return state


@compiled
def controller_tick(state: FloatArray, p: FloatArray, set_point_rad_s: float) -> None:
    """Run the speed loop once: read the encoder, compute the output that holds until the next tick.

    Args:
        state: State vector, (STATE,), changed in place.
        p: Parameter vector, (PARAMETERS,).
        set_point_rad_s: Speed of the wheel that is wanted.
    """
    speed = state[MOTOR_SPEED]
    if p[ENCODER_COUNTS] > 0.0:
        count = math.floor((state[WHEEL_ANGLE] + state[GAP]) * p[ENCODER_COUNTS] / (2.0 * math.pi))
        at = int(state[RING_AT])
        ticks = int(p[ENCODER_TICKS])
        counted = count - state[RING + at]
        state[RING + at] = count
        state[RING_AT] = (at + 1) % ticks
        speed = counted * 2.0 * math.pi / (p[ENCODER_COUNTS] * ticks * p[TICK_S])
    state[MEASURED_SPEED] += p[FILTER_SHARE] * (speed - state[MEASURED_SPEED])
    state[MEASURED_CURRENT] += p[FILTER_SHARE] * (state[CURRENT] - state[MEASURED_CURRENT])
    error = set_point_rad_s - state[MEASURED_SPEED]
    seen = error if p[DERIVATIVE_OF_ERROR] > 0.0 else -state[MEASURED_SPEED]
    rest = (
        p[FEED_FORWARD] * set_point_rad_s
        + p[KP] * error
        + p[KD] * (seen - state[DERIVED]) / p[TICK_S]
        + p[COMPENSATION] * state[MEASURED_CURRENT]
    )
    state[DERIVED] = seen
    limit = p[NOMINAL_SUPPLY]
    if p[CURRENT_KP] > 0.0:
        limit = p[CURRENT_LIMIT]
    elif p[SUPPLY_COMPENSATION] > 0.0:
        limit = state[SUPPLY]
    output = rest + state[SPEED_INTEGRAL] + p[KI] * error * p[TICK_S]
    if p[ANTI_WINDUP] > 0.0 and abs(output) > limit and output * error > 0.0:
        output = rest + state[SPEED_INTEGRAL]
    else:
        state[SPEED_INTEGRAL] += p[KI] * error * p[TICK_S]
    state[OUTPUT] = min(max(output, -limit), limit)


@compiled
def _relax(value: float, target: float, exponent: float) -> tuple[float, float]:
    """Return a first-order quantity after a step of `exponent` time constants, and its mean over the step."""
    left = math.exp(-exponent)
    mean = target + (value - target) * (-math.expm1(-exponent) / exponent)
    return target + (value - target) * left, mean


@compiled
def _step_current(state: FloatArray, p: FloatArray, h: float, time_s: float) -> float:
    """Step current and supply by `h` seconds; return the mean current."""
    resistance = p[RESISTANCE]
    if p[WINDING_WARMING] != 0.0:
        resistance *= 1.0 - p[WINDING_WARMING] * math.expm1(-time_s / p[WINDING_WARMING_S])
    supply = p[SUPPLY_V] * (1.0 - p[SUPPLY_FALL] * time_s) - p[SUPPLY_FALL_V] * time_s
    if p[SUPPLY_SWING] != 0.0:
        supply *= 1.0 + p[SUPPLY_SWING] * math.sin(p[SUPPLY_SWING_RAD_S] * time_s)
    limit, brake = p[CURRENT_LIMIT], p[BRAKE_CURRENT]
    if p[CURRENT_FADE] != 0.0:
        left = 1.0 + p[CURRENT_FADE] * math.expm1(-time_s / p[CURRENT_FADE_S])
        limit, brake = limit * left, brake * left
    # What the motor takes from the battery is its power; what it gives back is burnt elsewhere.
    taken = max(state[CURRENT] * state[VOLTS] / state[SUPPLY], 0.0)
    supply = max(supply - p[SUPPLY_RESISTANCE] * taken, 0.1 * p[SUPPLY_V])
    state[SUPPLY] = supply
    emf = p[BACK_EMF] * state[MOTOR_SPEED]
    i = state[CURRENT]
    if p[CURRENT_KP] > 0.0:
        # A current loop much faster than the speed loop, taken as continuous.
        kp = p[CURRENT_KP]
        wanted = min(max(state[OUTPUT], -limit), limit)
        if wanted * state[MOTOR_SPEED] < 0.0:
            wanted = min(max(wanted, -brake), brake)
        target = (kp * wanted + state[CURRENT_INTEGRAL] - emf) / (resistance + kp)
        after, mean = _relax(i, target, h * (resistance + kp) / p[INDUCTANCE])
        volts = kp * (wanted - mean) + state[CURRENT_INTEGRAL]
        if abs(volts) <= supply:
            state[CURRENT_INTEGRAL] += p[CURRENT_KI] * (wanted - mean) * h
            state[VOLTS] = volts
            state[CURRENT] = after
            return float(mean)
        volts = math.copysign(supply, volts)
    elif p[SUPPLY_COMPENSATION] > 0.0:
        volts = min(max(state[OUTPUT], -supply), supply)
    else:
        volts = min(max(state[OUTPUT] / p[NOMINAL_SUPPLY], -1.0), 1.0) * supply
    after, mean = _relax(i, (volts - emf) / resistance, h * resistance / p[INDUCTANCE])
    if mean * state[MOTOR_SPEED] < 0.0:
        limit = brake
    state[VOLTS] = volts
    state[CURRENT] = min(max(after, -limit), limit)
    return float(min(max(mean, -limit), limit))


@compiled
def _advance(speed: float, torque: float, coulomb: float, viscous: float, inertia: float, h: float) -> float:
    """Return a body's speed after `h`; friction slows it and can hold it, but never turns it."""
    momentum = inertia * speed + h * torque
    held = h * coulomb
    if abs(momentum) <= held:
        return 0.0
    return (momentum - math.copysign(held, momentum)) / (inertia + h * viscous)


@compiled
def plant_substep(state: FloatArray, p: FloatArray, load_n_m: float, h: float, time_s: float) -> None:
    """Step the motor, the gear and the wheel by `h` seconds.

    Args:
        state: State vector, (STATE,), changed in place.
        p: Parameter vector, (PARAMETERS,).
        load_n_m: External torque on the wheel's shaft, positive forwards, at the wheel's present speed; it
            changes with that speed within the step by `state[LOAD_SLOPE]`, which makes stiff contacts stable.
        h: Step [s]; 0.1 ms is small for every drive of the zoo.
        time_s: Time since the start of the run, at least 0, for what warms or runs down.
    """
    drive_torque = p[BACK_EMF] * _step_current(state, p, h, time_s)
    cold = 1.0
    if p[FRICTION_WARMING] != 0.0:
        cold = 1.0 + p[FRICTION_WARMING] * math.expm1(-time_s / p[FRICTION_WARMING_S])
    wm, w = state[MOTOR_SPEED], state[WHEEL_SPEED]
    jm, jw = p[MOTOR_INERTIA], p[WHEEL_INERTIA]
    fm, fw = p[MOTOR_COULOMB] * cold, p[WHEEL_COULOMB] * cold
    if p[WHEEL_STICKING] > 0.0:
        fw += p[WHEEL_STICKING] * cold * math.exp(-((w / p[STICKING_SPEED]) ** 2))
    if p[RUB] > 0.0 and (time_s * p[RUB_HZ]) % 1.0 < 0.2:
        fw += p[RUB]
    bm, bw = p[MOTOR_VISCOUS] * cold, p[WHEEL_VISCOUS] * cold + state[LOAD_SLOPE]
    bw += p[DRAG] * abs(w)
    torque = load_n_m + state[LOAD_SLOPE] * w
    if p[COGGING] != 0.0:
        torque += p[COGGING] * math.sin(p[COGGING_PER_TURN] * state[WHEEL_ANGLE] + p[COGGING_PHASE])
    half = p[HALF_PLAY]
    joined = half == 0.0
    gap = state[GAP]
    if not joined:
        spring = 0.0
        if p[PLAY_SPRING] > 0.0:
            # The twist at the end of the step, so that a stiff spring is stable.
            compliance = h * h * (1.0 / jm + 1.0 / jw)
            spring = p[PLAY_SPRING] * (gap + h * (wm - w)) / (1.0 + p[PLAY_SPRING] * compliance)
        motor_alone = _advance(wm, drive_torque - spring, fm, bm, jm, h)
        wheel_alone = _advance(w, torque + spring, fw, bw, jw, h)
        joined = state[CONTACT] != 0.0 and state[CONTACT] * (motor_alone - wheel_alone) >= 0.0
        if not joined:
            state[CONTACT] = 0.0
            gap += h * (motor_alone - wheel_alone)
            if abs(gap) >= half:
                # A collision without bounce: the momentum of both, shared.
                gap = math.copysign(half, gap)
                state[CONTACT] = math.copysign(1.0, gap)
                motor_alone = (jm * motor_alone + jw * wheel_alone) / (jm + jw)
                wheel_alone = motor_alone
            state[GAP] = gap
            state[MOTOR_SPEED] = motor_alone
            state[WHEEL_SPEED] = wheel_alone
    if joined:
        together = (jm * wm + jw * w) / (jm + jw)
        together = _advance(together, drive_torque + torque, fm + fw, bm + bw, jm + jw, h)
        state[MOTOR_SPEED] = together
        state[WHEEL_SPEED] = together
    state[WHEEL_ANGLE] += h * state[WHEEL_SPEED]
