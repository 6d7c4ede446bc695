"""A robot of the zoo: geometry, body, rollers, floor, four drives and the sensors that log it.

Every mechanism that a study can hide is a field here, so a changed robot is a robot with other values.
Wheels in the order fl, fr, rl, rr; x forward, y left, yaw counter-clockwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from sysid.studies.zoo.drives.drive import Drive

Four = tuple[float, float, float, float]


@dataclass(frozen=True)
class Wheels:
    """Four wheels with free rollers at 45 degrees in the usual X arrangement."""

    radius_m: float
    radius_scale: Four = (1.0, 1.0, 1.0, 1.0)
    """Of single wheels: wear, pressure."""
    width_m: float = 0.04
    rollers: int = 9
    """Rollers on a wheel, 3 to 12; the point of contact travels along each as the wheel turns."""
    handover: float = 0.15
    """Share of a roller's turn over which it shares its load with the next one."""
    angle_deg: float = 45.0
    """Between the axis of the lowest roller and the rolling direction."""
    start_deg: Four = (0.0, 0.0, 0.0, 0.0)
    """Wheel angles at the start; each run draws its own, because no robot is put down twice alike."""
    toe_deg: Four = (0.0, 0.0, 0.0, 0.0)
    """Misalignment of the axles, counter-clockwise positive."""


@dataclass(frozen=True)
class Rollers:
    """The bearings of the rollers."""

    coulomb_n: float = 0.0
    """Resistance at the roller's surface against rolling [N], per wheel."""
    viscous_n_s_m: float = 0.0
    blocked_wheel: int = -1
    """Wheel whose rollers also have `blocked_n_s_m`; -1: none."""
    blocked_n_s_m: float = 0.0


@dataclass(frozen=True)
class Body:
    """The chassis with everything on it, without a payload."""

    half_wheelbase_m: float
    half_track_m: float
    mass_kg: float
    yaw_inertia_kg_m2: float
    """About the vertical axis through the centre of mass, without a payload."""
    com_x_m: float = 0.0
    com_y_m: float = 0.0
    com_height_m: float = 0.1
    payload_kg: float = 0.0
    payload_height_m: float = 0.2
    payload_x_m: float = 0.0
    payload_y_m: float = 0.0
    twist: float = 0.0
    """Share of the weight that the diagonal fl-rr carries beyond half: a stiff frame stands on three feet."""


@dataclass(frozen=True)
class Floor:
    """Grip, slope and rolling resistance."""

    grip: float = 0.7
    """Coulomb coefficient along a roller's axis."""
    creep_m_s: float = 0.01
    """Slip at which about three quarters of the grip is used: rubber yields before it slides."""
    slope_deg: float = 0.0
    downhill_deg: float = 0.0
    """Direction of the fall in the world frame."""
    rolling_n: float = 0.0
    """Rolling resistance of the whole robot per wheel [N]."""
    wind_n: float = 0.0
    """Amplitude of a force along the world's x that swings at `wind_hz`."""
    wind_hz: float = 0.7


@dataclass(frozen=True)
class BodyCommandPath:
    """What the platform's computer does with V, theta and VC before it makes wheel commands."""

    v_limit_rpm: float = math.inf
    vc_limit_rpm: float = math.inf
    v_ramp_rpm_s: float = math.inf
    vc_ramp_rpm_s: float = math.inf


@dataclass(frozen=True)
class BodySensors:
    """Odometry, IMU or motion capture: which channels are logged, how late and how wrong."""

    velocity: bool = True
    """Whether vx, vy and the yaw rate are logged."""
    pose: bool = False
    noise_m_s: float = 0.005
    noise_rad_s: float = 0.01
    noise_m: float = 0.002
    noise_rad: float = 0.002
    turned_deg: float = 0.0
    """Yaw of the sensor against the body, positive as the contract's `mount_yaw`."""
    lever_x_m: float = 0.0
    lever_y_m: float = 0.0
    """Position of the velocity sensor: it sees the rotation as velocity."""
    tilt_deg: float = 0.0
    """Of the velocity sensor about its sideways axis: it sees forward speed and yaw rate times the cosine."""
    crosstalk: float = 0.0
    """Of vx into the yaw rate [rad/m]."""
    late_s: float = 0.0
    """Delay of velocity channels."""
    pose_late_s: float = 0.0
    wheels_late_s: float = 0.0
    filter_s: float = 0.0
    """First-order filter of the body velocities."""
    window_s: float = 0.0
    """Moving average of the body velocities."""
    linear_scale: float = 1.0
    yaw_scale: float = 1.0
    wheel_scale: float = 1.0
    bias_vx_m_s: float = 0.0
    bias_vy_m_s: float = 0.0
    bias_yaw_rate_rad_s: float = 0.0
    drift_yaw_rate_rad_s2: float = 0.0
    """Rate at which the yaw rate's bias grows."""
    drop_outs: float = 0.0
    """Share of pose samples that are missing, in gaps of `drop_out_s`."""
    drop_out_s: float = 0.1
    jump_m: float = 0.0
    """Distance by which motion capture is off along x, in stretches of `jump_s`: it takes another marker for
    the robot's."""
    jump_share: float = 0.1
    """Share of the time that such stretches fill."""
    jump_s: float = 0.3


@dataclass(frozen=True)
class Robot:
    """One robot on one floor."""

    wheels: Wheels
    rollers: Rollers
    body: Body
    floor: Floor
    drive: Drive
    """The drive of each wheel; its gear carries the wheel's own inertia."""
    wheel_gains: Four = (1.0, 1.0, 1.0, 1.0)
    path: BodyCommandPath = field(default_factory=BodyCommandPath)
    sensors: BodySensors = field(default_factory=BodySensors)
