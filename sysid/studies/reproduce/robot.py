"""The robot's own motion: straight drives and a turn in place on rollers (Fig. 7, section 4.5)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from mecanum_env.kinematics import command_to_twist, round_command, twist_to_command
from mecanum_env.law import WheelLaw
from mecanum_env.law.metrics import step_metrics
from mecanum_env.model import Model, paper_model
from mecanum_env.simulator import BodyCommands, RobotPlant, Trajectory, drive
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.studies.reproduce import published

HOLD_S = 3.0
_STOP_S = 1.5
_DRAWN_S = 0.01


@dataclass(frozen=True, eq=False)
class RobotDrive:
    """One drive from rest to a speed, held, and back to rest; speeds in `unit`, times in seconds."""

    name: str
    unit: str
    """rpm of a wheel that rolls as fast as the body moves, or rad/s."""
    commanded: float
    steady: float
    loss: float
    """(commanded - steady) / commanded of the body."""
    wheel_loss: float
    """(commanded - steady) / commanded of the mean wheel speed: the loss before the floor."""
    paper_loss: float
    rise_s: float
    """10 to 90 % of the body's speed."""
    wheel_rise_s: float
    """10 to 90 % of the mean wheel speed."""
    fall_s: float
    """90 to 10 % of the body's speed after the stop."""
    peak_acceleration: float
    """Largest mean acceleration of the body over 0.1 s while starting [unit/s]."""
    time_s: FloatArray
    """Every 0.01 s, shape (n,)."""
    body: FloatArray
    """Speed of the body, shape (n,)."""
    law: FloatArray
    """Speed that the wheel law alone gives, without load, limits and slip, shape (n,)."""


def wheel_model(law: WheelLaw) -> Model:
    """Return the paper's robot with an identified `law` in its wheels."""
    base = paper_model()
    return replace(base, wheel=replace(base.wheel, law=law, saturation_rpm=published.CEILING_RPM))


def robot_drives(model: Model, plant: RobotPlant = "rollers") -> list[RobotDrive]:
    """Simulate the paper's five drives on a plant."""
    _, _, turn_rpm = twist_to_command([0.0, 0.0, published.ROTATION_RAD_S], model.robot)
    commands = {f"straight {v} rpm": (float(v), 0.0) for v in published.FIT_STEPS_RPM}
    commands[f"turn {published.ROTATION_RAD_S} rad/s"] = (0.0, float(turn_rpm))
    return [_robot_drive(model, name, *command, plant) for name, command in commands.items()]


def _robot_drive(
    model: Model, name: str, v_rpm: float, vc_rpm: float, plant: RobotPlant = "rollers"
) -> RobotDrive:
    """Simulate one drive, a name in `published.ROBOT_LOSS`, on a plant and return its metrics."""
    v, _, vc = (float(x) for x in round_command(v_rpm, 0.0, vc_rpm, model.wheel.command_quantum_rpm))
    commands = BodyCommands.from_rows([(0.0, v, 0.0, vc), (HOLD_S, 0.0, 0.0, 0.0)])
    path = drive(model, commands, HOLD_S + _STOP_S, plant=plant)
    axis = 2 if v == 0.0 else 0
    scale = 1.0 if axis == 2 else 1.0 / (model.robot.wheel_radius_m * RAD_S_PER_RPM)
    commanded = float(command_to_twist(v, 0.0, vc, model.robot)[axis]) * scale
    time, body, wheels = path.time_s, path.twist[:, axis] * scale, np.mean(np.abs(path.wheels_rpm), axis=1)
    going, stopping = time <= HOLD_S, time >= HOLD_S
    # The ripple of the rollers is not noise; it must not widen the settling band.
    up = step_metrics(time[going], body[going], 0.0, commanded, noise_rpm=0.0)
    turned = step_metrics(time[going], wheels[going], 0.0, abs(v) + abs(vc), noise_rpm=0.0)
    down = step_metrics(time[stopping], body[stopping], up.steady_rpm, 0.0, step_time_s=HOLD_S, noise_rpm=0.0)
    drawn = slice(None, None, max(1, round(_DRAWN_S / path.mj_model.opt.timestep)))
    return RobotDrive(
        name=name,
        unit="rad/s" if axis == 2 else "rpm",
        commanded=commanded,
        steady=up.steady_rpm,
        loss=-up.relative_steady_state_error,
        wheel_loss=-turned.relative_steady_state_error,
        paper_loss=published.ROBOT_LOSS[name],
        rise_s=up.rise_time_s,
        wheel_rise_s=turned.rise_time_s,
        fall_s=down.rise_time_s,
        peak_acceleration=_peak_acceleration(path, body),
        time_s=time[drawn],
        body=body[drawn],
        law=commanded * _law_share(model.wheel.law, commands, time[drawn]),
    )


def _peak_acceleration(path: Trajectory, speed: FloatArray) -> float:
    tenth = round(0.1 / path.mj_model.opt.timestep)
    return float((speed[tenth:] - speed[:-tenth]).max() / 0.1)


def _law_share(law: WheelLaw, commands: BodyCommands, time_s: FloatArray) -> FloatArray:
    """Return the speed of an unloaded wheel over its command at given times, shape (n,)."""
    ticks = np.arange(math.ceil(time_s[-1] / law.sample_period_s) + 1) * law.sample_period_s
    held = (np.abs(commands.at(ticks[:-1])).sum(axis=-1) > 0.0).astype(float)
    return np.interp(time_s, ticks, law.simulate(held))
