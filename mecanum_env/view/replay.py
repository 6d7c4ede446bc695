"""A log and its simulation by a model, side by side: the channels, their difference, the motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import mujoco
import numpy as np

from mecanum_env.effects.apply import in_turned_axes
from mecanum_env.errors import InputError
from mecanum_env.kinematics import POSE, TWIST, WHEEL_SPEEDS
from mecanum_env.model import Model
from mecanum_env.simulator import BodyCommands, Commands, RobotPlant, WheelCommands, drive, replay_bench
from mecanum_env.simulator.commands import read_commands
from mecanum_env.simulator.supply import Supply
from mecanum_env.simulator.trajectory import CHANNELS
from mecanum_env.tables import Table, read_table
from mecanum_env.units import FloatArray

_WHEEL_NAMES: Final = ("front left", "front right", "rear left", "rear right")
SHOWN: Final[Mapping[str, tuple[str, str]]] = {
    "speed_rpm": ("wheel", "rpm"),
    **{column: (name, "rpm") for column, name in zip(WHEEL_SPEEDS, _WHEEL_NAMES, strict=True)},
    "vx_m_s": ("ahead", "m/s"),
    "vy_m_s": ("left", "m/s"),
    "yaw_rate_rad_s": ("turn", "rad/s"),
    "x_m": ("x", "m"),
    "y_m": ("y", "m"),
    "yaw_rad": ("heading", "rad"),
}
"""Channel -> what it is called and its unit, as people read them."""
_BENCH: Final = ("command_rpm", "speed_rpm")
_ROUNDING: Final = 1e-6  # rounding error of stamps, in command periods


@dataclass(frozen=True, eq=False)
class Log:
    """A recording of the robot, or of one wheel on the bench."""

    name: str
    time_s: FloatArray
    """Stamps from the first one on [s], shape (n,)."""
    channels: Mapping[str, FloatArray]
    """Measured columns by name, shape (n,); NaN where a sample is missing."""
    commands: Commands | None
    """Commands of the robot; None on the bench."""
    command_rpm: FloatArray | None = None
    """Commanded speed of the wheel on the bench [rpm], shape (n,); None for the robot."""
    battery_v: FloatArray | None = None
    """Voltage of the supply [V], shape (n,), if it was logged."""

    def pose(self) -> FloatArray | None:
        """Return the pose x, y [m], yaw [rad] in the world, shape (n, 3), or None if nothing shows it.

        Without a measured pose the measured velocity is summed up from the origin.
        """
        if all(name in self.channels for name in POSE):
            return np.stack([_filled(self.time_s, self.channels[name]) for name in POSE], axis=1)
        if not all(name in self.channels for name in TWIST):
            return None
        vx, vy, rate = (_filled(self.time_s, self.channels[name]) for name in TWIST)
        yaw = _summed(self.time_s, rate)
        x = _summed(self.time_s, np.cos(yaw) * vx - np.sin(yaw) * vy)
        y = _summed(self.time_s, np.sin(yaw) * vx + np.cos(yaw) * vy)
        return np.stack([x, y, yaw], axis=1)


def read_log(path: Path) -> Log:
    """Read a log of the robot or of one wheel on the bench, a CSV or Parquet file.

    Raises:
        InputError: it cannot be read, has no commands, or nothing measured; the message names what is wrong.
    """
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "no such file"
        raise InputError(f"{path}: {what}; --log takes one log, such as @examples/logs/step_080_1.csv")
    table = read_table(path)
    _check_stamps(table)
    bench = "command_rpm" in table.names
    known = _BENCH[1:] if bench else CHANNELS
    found = {name: table.column(name) for name in known if name in table.names}
    measured = {name: values for name, values in found.items() if np.isfinite(values).sum() >= 2}
    if not measured or len(table.values) < 2:
        raise InputError(f"{table.header}: nothing measured to compare with; known: {', '.join(known)}")
    voltage = table.column("battery_v") if "battery_v" in table.names else None
    if bench:
        time, command = table.column("time_s"), table.column("command_rpm")
        return Log(path.name, time - time[0], measured, None, command, voltage)
    commands = read_commands(path)
    return Log(path.name, commands.time_s, measured, commands, None, voltage)


def _check_stamps(table: Table) -> None:
    if "time_s" not in table.names:
        raise InputError(f"{table.header}: no column time_s; the file has {', '.join(table.names)}")
    time = table.column("time_s")
    wrong = np.flatnonzero(~(np.diff(time, prepend=-np.inf) > 0.0))
    if wrong.size:
        row = int(wrong[0])
        raise InputError(f"{table.where(row)}: time_s = {time[row]:g}, must be larger than the stamp before")


@dataclass(frozen=True, eq=False)
class Drive:
    """How a robot has driven, for drawing; it starts at the origin."""

    mj_model: mujoco.MjModel
    """The robot that was simulated."""
    time_s: FloatArray
    """Physics clock [s], shape (m,)."""
    qpos: FloatArray
    """MuJoCo's generalised positions on it, shape (m, nq)."""
    logged_pose: FloatArray | None
    """The log's pose at its stamps, seen from where the robot started, shape (n, 3), if the log shows it."""


@dataclass(frozen=True, eq=False)
class Replay:
    """A log with what a model predicts for it."""

    log: Log
    simulated: Mapping[str, FloatArray]
    """The measured channels as simulated, at the log's stamps, shape (n,)."""
    robot: Drive | None = None
    """The simulated robot; None on the bench."""

    def rms(self) -> dict[str, float]:
        """Return the root mean square of measured minus simulated, by channel, in its own unit."""
        return {
            name: float(np.sqrt(np.nanmean((self.log.channels[name] - values) ** 2)))
            for name, values in self.simulated.items()
        }


def replay(model: Model, log: Log, plant: RobotPlant = "rollers") -> Replay:
    """Simulate a log's commands, from rest, and return both side by side.

    A robot is simulated on the `plant`; the pose is counted from the log's first one.

    Raises:
        InputError: the plant, or the bench, cannot simulate the model.
        SimulationDivergedError: the state stopped being finite.
    """
    if log.commands is None:
        assert log.command_rpm is not None  # a log has either
        first = float(log.channels["speed_rpm"][np.isfinite(log.channels["speed_rpm"])][0])
        # A wheel that turns with its command when the log begins has turned so for long.
        moving = log.command_rpm[0] != 0.0 and abs(first) > 0.5 * abs(log.command_rpm[0])
        speed = replay_bench(
            model,
            log.time_s,
            log.command_rpm,
            initial_rpm=first if moving else 0.0,
            battery_v=log.battery_v,
        )
        return Replay(log, {"speed_rpm": speed})
    pose = log.pose()
    start = np.zeros(3) if pose is None else pose[0]
    path = drive(
        in_turned_axes(model, float(start[2])),
        _as_held(log.commands, model.wheel.command_period_s),
        float(log.time_s[-1]),
        plant=plant,
        supply=Supply.logged(log.time_s, log.battery_v),
    )
    channels = path.channels_at(log.time_s)
    if all(name in log.channels for name in POSE):
        turned = _moved(np.stack([channels[name] for name in POSE], axis=1), start)
        channels |= dict(zip(POSE, turned.T, strict=True))
    logged = None if pose is None else _seen_from(pose, start)
    shown = {name: channels[name] for name in CHANNELS if name in log.channels}
    return Replay(log, shown, Drive(path.mj_model, path.time_s, path.qpos, logged))


def _as_held(commands: Commands, period_s: float) -> Commands:
    """Return commands at the times at which the robot may have held them first.

    A log shows a command in the first row after it was given. The robot looks for one at multiples of its
    period; the first row after such a time is taken to show what the robot found then. Otherwise a command
    that was logged some microseconds late would be replayed a whole period late.
    """
    time = commands.time_s
    looked = np.floor(time / period_s + _ROUNDING) * period_s
    before = np.concatenate([[-np.inf], time[:-1]])
    held = np.where(looked > before + _ROUNDING * period_s, looked, time)
    if isinstance(commands, WheelCommands):
        return WheelCommands(held, commands.wheels_rpm)
    return BodyCommands(held, commands.v_rpm, commands.theta_deg, commands.vc_rpm)


def _moved(pose: FloatArray, start: FloatArray) -> FloatArray:
    """Return poses (n, 3) that are counted from a start (3,), in the start's own frame."""
    cos, sin = np.cos(start[2]), np.sin(start[2])
    x, y, yaw = pose.T
    return np.stack([start[0] + cos * x - sin * y, start[1] + sin * x + cos * y, start[2] + yaw], axis=1)


def _seen_from(pose: FloatArray, start: FloatArray) -> FloatArray:
    """Return poses (n, 3) as seen from a start (3,), the inverse of `_moved`."""
    cos, sin = np.cos(start[2]), np.sin(start[2])
    x, y, yaw = (pose - start).T
    return np.stack([cos * x + sin * y, cos * y - sin * x, yaw], axis=1)


def _filled(time_s: FloatArray, values: FloatArray) -> FloatArray:
    finite = np.isfinite(values)
    return np.interp(time_s, time_s[finite], values[finite])


def _summed(time_s: FloatArray, rate: FloatArray) -> FloatArray:
    """Return the integral of a rate (n,) from the first time on, by the trapezoidal rule, shape (n,)."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time_s))])
