"""The roller robot, changed by hand in its MjSpec, its command arrays and its logged arrays.

No effect of the catalogue is used. The wheels' own latch is switched to every step, so that what is done to
the commands here acts when it is done.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from scipy.signal import lfilter

from mecanum_env.mjcf import bench_spec, robot_spec
from mecanum_env.model import Model, paper_model

WHEELS = ("fl", "fr", "rl", "rr")
SAMPLE_S = 0.01
COMMAND_S = 0.1
NOISE = {"speed": 0.5, "v": 0.005, "yaw_rate": 0.01, "xy": 0.002, "yaw": 0.002}
RPM = math.pi / 30.0


@dataclass(frozen=True)
class HiddenRobot:
    """What is done to the robot; each field's default is nothing."""

    # Bodies, joints and floor.
    wheel_drag_n_m: float = 0.0
    wheel_oil_n_m_s: float = 0.0
    roller_drag_n_m: float = 0.0
    roller_oil_n_m_s: float = 0.0
    load_kg: float = 0.0
    load_height_m: float = 0.2
    com_x_m: float = 0.0
    com_y_m: float = 0.0
    grip: float = 0.8
    slope_deg: float = 0.0
    downhill_deg: float = 0.0
    radius: float = 1.0
    arms: float = 1.0
    """Half wheelbase and half track, over the model's."""
    stiffness: float = 5.0

    # Commands.
    late_s: float = 0.0
    v_top: float = math.inf
    vc_top: float = math.inf
    v_ramp: float = math.inf
    vc_ramp: float = math.inf
    ignored_below_rpm: float = 0.0
    all_motors: float = 1.0
    weak_motor: int = 0
    """Which, 0 to 3."""
    weak_share: float = 1.0
    reverse: float = 1.0
    fall_per_s: float = 0.0
    wheel_top: float = 135.0
    wheel_ramp: float = math.inf

    # Logged arrays.
    turned_deg: float = 0.0
    log_late_s: float = 0.0
    log_filter_s: float = 0.0
    wheel_factor: float = 1.0
    linear_factor: float = 1.0
    yaw_factor: float = 1.0
    vx_offset: float = 0.0
    vy_offset: float = 0.0
    yaw_offset: float = 0.0

    # Outside the catalogue.
    lever_m: float = 0.0
    """The velocity sensor sits this far ahead of the centre: it sees the rotation in vy."""
    blocked_rollers: float = 0.0
    """Damping of the rollers of one wheel [N m s/rad]."""
    rising_gain: float = 0.0
    warming: float = 0.0
    wind_n: float = 0.0
    """A force that swings along the world's x at 0.7 Hz."""
    crosstalk: float = 0.0
    """Of vx into the yaw rate [rad/m]."""


def simulate(
    hidden: HiddenRobot, commands: np.ndarray, pose: bool, rngs: list[np.random.Generator]
) -> tuple[np.ndarray, list[dict[str, np.ndarray]]]:
    """Return sample times (n,) [s] and, for each repeat, channel -> samples (n,), with noise.

    Each repeat is driven anew: its wheels start turned by some hundredths of a radian, as no robot is put
    down twice alike.

    Args:
        hidden: what is done to the robot.
        commands: (m, 3), V [rpm], theta [deg], VC [rpm], one row per 0.1 s.
        pose: whether the pose is logged too.
        rngs: one a repeat.
    """
    model = compiled(hidden)
    step = model.opt.timestep
    clock = np.arange(round(len(commands) * COMMAND_S / step) + 1) * step
    wheels = _wheels(hidden, commands, clock[:-1])
    time_s = np.arange(math.floor(clock[-1] / SAMPLE_S + 1e-9) + 1) * SAMPLE_S
    logged = []
    for rng in rngs:
        qpos, qvel = _stepped(model, hidden, wheels, 0.01 * rng.standard_normal(4))
        true = _sensed(hidden, clock, _channels(model, qpos, qvel, pose))
        logged.append(
            {
                name: np.interp(time_s, clock, values) + _noise(name) * rng.standard_normal(time_s.size)
                for name, values in true.items()
            }
        )
    return time_s, logged


def lifted_wheel(
    commands: np.ndarray, rngs: list[np.random.Generator]
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return sample times (n,) [s] and logged speeds, one a repeat, of a wheel that turns freely.

    Args:
        commands: (m,) [rpm], one per 0.1 s.
        rngs: one a repeat.
    """
    model = bench_spec(nominal(), visuals=False).compile()
    data = mujoco.MjData(model)
    n = round(len(commands) * COMMAND_S / model.opt.timestep)
    speed = np.zeros(n + 1)
    for k in range(n):
        data.ctrl[0] = commands[int(k * model.opt.timestep / COMMAND_S + 1e-6)]
        mujoco.mj_step(model, data)
        speed[k + 1] = data.qvel[0] / RPM
    rows = np.arange(0, n + 1, round(1 / 120 / model.opt.timestep))
    time_s = rows * model.opt.timestep
    return time_s, [speed[rows] + NOISE["speed"] * rng.standard_normal(rows.size) for rng in rngs]


def nominal() -> Model:
    """Return the model whose robot is simulated, without effects."""
    return paper_model()


def compiled(hidden: HiddenRobot) -> mujoco.MjModel:
    """Return the changed robot."""
    model = nominal()
    robot = replace(
        model.robot,
        wheel_radius_m=model.robot.wheel_radius_m * hidden.radius,
        half_wheelbase_m=model.robot.half_wheelbase_m * hidden.arms,
        half_track_m=model.robot.half_track_m * hidden.arms,
    )
    spec = robot_spec(replace(model, robot=robot), wheel_quantum=False, visuals=False)
    for joint in spec.joints:
        rolls = "_roller_" in joint.name
        wheel = joint.name.startswith("wheel_") and not rolls
        drag = hidden.wheel_drag_n_m if wheel else hidden.roller_drag_n_m if rolls else 0.0
        if drag:
            joint.frictionloss = drag
            joint.solref_friction = [0.005, 1.0]
            joint.solimp_friction = [0.998, 0.9999, 0.001, 0.5, 2.0]
        if wheel:
            joint.damping[0] += hidden.wheel_oil_n_m_s
        if rolls:
            joint.damping[0] += hidden.roller_oil_n_m_s
            if joint.name.startswith("wheel_rl"):
                joint.damping[0] += hidden.blocked_rollers
    base = spec.body("base")
    share = robot.mass_kg / float(base.mass)
    base.ipos = [base.ipos[0] + share * hidden.com_x_m, base.ipos[1] + share * hidden.com_y_m, base.ipos[2]]
    if hidden.load_kg:
        load = base.add_body(name="load", pos=[0.0, 0.0, hidden.load_height_m - robot.wheel_radius_m])
        load.explicitinertial = True
        load.mass, load.ipos = hidden.load_kg, [0.0, 0.0, 0.0]
        load.inertia = [0.4 * hidden.load_kg * 0.08**2] * 3  # a ball of 8 cm
    for pair in spec.pairs:
        pair.friction[0] = pair.friction[1] = hidden.grip
    made = spec.compile()
    made.actuator_dynprm[:, 7] = made.opt.timestep
    made.actuator_dynprm[:, 9] = 0.0
    made.actuator_biasprm[:, 2] = -hidden.stiffness
    return made


def _wheels(hidden: HiddenRobot, commands: np.ndarray, clock: np.ndarray) -> np.ndarray:
    """Return the wheel commands [rpm] at each physics step, shape (n, 4)."""
    index = np.floor((clock - hidden.late_s) / COMMAND_S + 1e-6).astype(int)
    v, theta, vc = np.where((index < 0)[:, np.newaxis], 0.0, commands[np.maximum(index, 0)]).T
    forward, left = v * np.cos(np.radians(theta)), v * np.sin(np.radians(theta))
    speed = np.maximum(np.hypot(forward, left), 1e-12)
    shrink = np.minimum(1.0, hidden.v_top / speed)
    body = np.stack([forward * shrink, left * shrink, np.clip(vc, -hidden.vc_top, hidden.vc_top)], axis=1)
    step = clock[1] - clock[0]
    if math.isfinite(hidden.v_ramp) or math.isfinite(hidden.vc_ramp):
        last = np.zeros(3)
        for k, wanted in enumerate(body):
            change = wanted - last
            length = math.hypot(change[0], change[1])
            change[:2] *= min(1.0, hidden.v_ramp * step / max(length, 1e-12))
            most = hidden.vc_ramp * step
            change[2] = min(max(change[2], -most), most)
            last = last + change
            body[k] = last
    x, y, turn = body.T
    wheels = np.stack([x - y - turn, x + y + turn, x + y - turn, x - y + turn], axis=1)
    wheels = np.where(np.abs(wheels) < hidden.ignored_below_rpm, 0.0, wheels)
    share = np.full(4, hidden.all_motors)
    share[hidden.weak_motor] *= hidden.weak_share
    wheels = wheels * share
    wheels = np.where(wheels < 0.0, wheels * hidden.reverse, wheels)
    gain = 1.0 - hidden.fall_per_s * clock - hidden.warming * (1.0 - np.exp(-clock / 0.5))
    wheels = wheels * (gain[:, np.newaxis] + hidden.rising_gain * (np.abs(wheels) / 100.0 - 0.5))
    wheels = np.clip(wheels, -hidden.wheel_top, hidden.wheel_top)
    if math.isfinite(hidden.wheel_ramp):
        most, last = hidden.wheel_ramp * step, np.zeros(4)
        for k, wanted in enumerate(wheels):
            last = last + np.clip(wanted - last, -most, most)
            wheels[k] = last
    return wheels


def _stepped(
    model: mujoco.MjModel, hidden: HiddenRobot, wheels: np.ndarray, turned: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Settle on the level, tilt the floor, drive; return qpos and qvel at every step, the start included."""
    slope, downhill = math.radians(hidden.slope_deg), math.radians(hidden.downhill_deg)
    g = 9.81
    model.opt.gravity[:] = 0.0, 0.0, -g
    data = mujoco.MjData(model)
    for wheel, angle in zip(WHEELS, turned, strict=True):
        data.qpos[model.joint(f"wheel_{wheel}").qposadr[0]] = angle
    mujoco.mj_step(model, data, round(0.6 / model.opt.timestep))
    standing = data.qpos.copy()
    mujoco.mj_resetData(model, data)
    data.qpos[:] = standing
    model.opt.gravity[:] = (
        g * math.sin(slope) * math.cos(downhill),
        g * math.sin(slope) * math.sin(downhill),
        -g * math.cos(slope),
    )
    mujoco.mj_forward(model, data)
    n = len(wheels)
    qpos, qvel = np.empty((n + 1, model.nq)), np.empty((n + 1, model.nv))
    qpos[0], qvel[0] = data.qpos, data.qvel
    base = model.body("base").id
    for k, ctrl in enumerate(wheels):
        data.ctrl[:] = ctrl
        data.xfrc_applied[base, 0] = hidden.wind_n * math.sin(2 * math.pi * 0.7 * k * model.opt.timestep)
        mujoco.mj_step(model, data)
        qpos[k + 1], qvel[k + 1] = data.qpos, data.qvel
    return qpos, qvel


def _channels(model: mujoco.MjModel, qpos: np.ndarray, qvel: np.ndarray, pose: bool) -> dict[str, np.ndarray]:
    w, x, y, z = qpos[:, 3:7].T
    yaw = np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
    cos, sin = np.cos(yaw), np.sin(yaw)
    found = {f"speed_{wheel}_rpm": qvel[:, model.joint(f"wheel_{wheel}").dofadr[0]] / RPM for wheel in WHEELS}
    found["vx_m_s"] = cos * qvel[:, 0] + sin * qvel[:, 1]
    found["vy_m_s"] = cos * qvel[:, 1] - sin * qvel[:, 0]
    found["yaw_rate_rad_s"] = qvel[:, 5]
    if pose:
        found |= {"x_m": qpos[:, 0] - qpos[0, 0], "y_m": qpos[:, 1] - qpos[0, 1], "yaw_rad": yaw - yaw[0]}
    return found


def _sensed(hidden: HiddenRobot, clock: np.ndarray, channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    shown = dict(channels)
    shown["vy_m_s"] = shown["vy_m_s"] + hidden.lever_m * channels["yaw_rate_rad_s"]
    shown["yaw_rate_rad_s"] = shown["yaw_rate_rad_s"] + hidden.crosstalk * channels["vx_m_s"]
    cos, sin = math.cos(math.radians(hidden.turned_deg)), math.sin(math.radians(hidden.turned_deg))
    for a, b in (("vx_m_s", "vy_m_s"), ("x_m", "y_m")):
        if a in shown:
            shown[a], shown[b] = cos * shown[a] + sin * shown[b], cos * shown[b] - sin * shown[a]
    factors = {"vx_m_s": hidden.linear_factor, "vy_m_s": hidden.linear_factor}
    factors |= {"yaw_rate_rad_s": hidden.yaw_factor}
    offsets = {"vx_m_s": hidden.vx_offset, "vy_m_s": hidden.vy_offset, "yaw_rate_rad_s": hidden.yaw_offset}
    for name, values in shown.items():
        late = np.interp(clock - hidden.log_late_s, clock, values)
        if hidden.log_filter_s:
            pole = math.exp(-(clock[1] - clock[0]) / hidden.log_filter_s)
            mean = (1.0 - pole) * hidden.log_filter_s / (clock[1] - clock[0])
            late = lfilter([1.0 - mean, mean - pole], [1.0, -pole], late - late[0]) + late[0]
        factor = hidden.wheel_factor if name.startswith("speed_") else factors.get(name, 1.0)
        shown[name] = factor * late + offsets.get(name, 0.0)
    return shown


def _noise(name: str) -> float:
    if name in ("x_m", "y_m"):
        return NOISE["xy"]
    return next(std for start, std in NOISE.items() if name.startswith(start)) if name != "yaw_rad" else 0.002
