"""What odometry, gyroscope and motion capture make of a robot's true motion."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from sysid.studies.zoo.drives.arrays import FloatArray
from sysid.studies.zoo.drives.sensor import Samples, sample
from sysid.studies.zoo.robots.engine import RobotMotion
from sysid.studies.zoo.robots.robot import BodySensors, Robot


def wheel_channels(
    robot: Robot, motion: RobotMotion, duration_s: float, rng: np.random.Generator
) -> tuple[Samples, dict[str, FloatArray]]:
    """Return the logger's rows, as the first wheel has them, and the four measured wheel speeds [rpm].

    The wheels share the logger's clock; noise, encoder phases and lost samples are their own.
    """
    own, sensors = robot.drive.sensor, robot.sensors
    sensor = replace(own, late_s=own.late_s + sensors.wheels_late_s, scale=own.scale * sensors.wheel_scale)
    clock = int(rng.integers(2**63))
    rows = [
        sample(sensor, wheel, duration_s, each, np.random.default_rng(clock))
        for wheel, each in zip(motion.wheels, rng.spawn(4), strict=True)
    ]
    names = ("speed_fl_rpm", "speed_fr_rpm", "speed_rl_rpm", "speed_rr_rpm")
    return rows[0], {name: each.speed_rpm for name, each in zip(names, rows, strict=True)}


def velocity_channels(
    motion: RobotMotion, sensors: BodySensors, stamps_s: FloatArray, rng: np.random.Generator
) -> dict[str, FloatArray]:
    """Return vx, vy [m/s] and yaw rate [rad/s] as logged at the stamps, each of shape (m,)."""
    vx, vy, rate = motion.twist.T
    vx, vy = vx - rate * sensors.lever_y_m, vy + rate * sensors.lever_x_m
    vx, vy = _turned(vx, vy, sensors.turned_deg)
    upright = math.cos(math.radians(sensors.tilt_deg))
    vx, rate = upright * vx, upright * rate
    rate = rate + sensors.crosstalk * vx
    scales = (sensors.linear_scale, sensors.linear_scale, sensors.yaw_scale)
    biases = (sensors.bias_vx_m_s, sensors.bias_vy_m_s, sensors.bias_yaw_rate_rad_s)
    noises = (sensors.noise_m_s, sensors.noise_m_s, sensors.noise_rad_s)
    step = motion.time_s[1] - motion.time_s[0]
    names, shown = ("vx_m_s", "vy_m_s", "yaw_rate_rad_s"), {}
    for name, true, scale, bias, noise in zip(names, (vx, vy, rate), scales, biases, noises, strict=True):
        smooth = _averaged(_filtered(true, step, sensors.filter_s), step, sensors.window_s)
        seen = np.interp(stamps_s - sensors.late_s, motion.time_s, smooth)
        shown[name] = scale * seen + bias + noise * rng.standard_normal(stamps_s.size)
    shown["yaw_rate_rad_s"] += sensors.drift_yaw_rate_rad_s2 * stamps_s
    return shown


def pose_channels(
    motion: RobotMotion, sensors: BodySensors, stamps_s: FloatArray, rng: np.random.Generator
) -> dict[str, FloatArray]:
    """Return x, y [m] and yaw [rad] as logged at the stamps, shape (m,), with NaN where a sample is missing.

    A mount that is turned on the robot turns the frame in which the path begins; the yaw, which counts from
    there, stays.
    """
    x, y = _turned(motion.pose[:, 0], motion.pose[:, 1], sensors.turned_deg)
    then = stamps_s - sensors.pose_late_s
    noises = (sensors.noise_m, sensors.noise_m, sensors.noise_rad)
    shown = {
        name: np.interp(then, motion.time_s, true) + noise * rng.standard_normal(stamps_s.size)
        for name, true, noise in zip(
            ("x_m", "y_m", "yaw_rad"), (x, y, motion.pose[:, 2]), noises, strict=True
        )
    }
    missing = _gaps(stamps_s, sensors.drop_outs, sensors.drop_out_s, rng)
    if sensors.jump_m != 0.0:
        shown["x_m"][_gaps(stamps_s, sensors.jump_share, sensors.jump_s, rng)] += sensors.jump_m
    for channel in shown.values():
        channel[missing] = np.nan
    return shown


def _turned(x: FloatArray, y: FloatArray, angle_deg: float) -> tuple[FloatArray, FloatArray]:
    """Return a vector in a frame that is turned counter-clockwise by an angle."""
    cos, sin = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    return cos * x + sin * y, cos * y - sin * x


def _filtered(values: FloatArray, step_s: float, lag_s: float) -> FloatArray:
    """Return values (n,) on an even clock behind a first-order filter that begins at 0."""
    if lag_s <= 0.0:
        return values
    pole = math.exp(-step_s / lag_s)
    return np.asarray(lfilter([1.0 - pole], [1.0, -pole], values))


def _averaged(values: FloatArray, step_s: float, window_s: float) -> FloatArray:
    """Return the mean of the last `window_s` of values (n,) on an even clock, which were 0 before it."""
    if window_s <= 0.0:
        return values
    ends = np.arange(values.size) * step_s
    area = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * step_s)])
    return np.asarray((area - np.interp(ends - window_s, ends, area)) / window_s)


def _gaps(
    stamps_s: FloatArray, share: float, gap_s: float, rng: np.random.Generator
) -> npt.NDArray[np.bool_]:
    """Return which stamps lie in gaps of a length that begin anywhere and fill a share of the time."""
    length = stamps_s[-1] - stamps_s[0] + gap_s
    begins = stamps_s[0] - gap_s + length * rng.random(rng.poisson(share * length / gap_s))
    since = stamps_s[:, None] - begins[None, :]
    return np.asarray(((since >= 0.0) & (since < gap_s)).any(axis=1))
