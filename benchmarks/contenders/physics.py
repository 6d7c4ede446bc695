"""The motion of this project's robot and of the peers' models, and what it costs at equal accuracy."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from tqdm import tqdm

from contenders.table import Table, number, over, spread
from contenders.wheels import (
    MUJOCO_DEFAULT,
    STIFF,
    Contact,
    PeerRobot,
    capsule_wheel,
    picknik_like,
    sphere_wheel,
)
from mecanum_env.kinematics import command_to_twist, command_to_wheels
from mecanum_env.mjcf import planar_spec, robot_spec
from mecanum_env.mjcf.geometry import sideways_ratio
from mecanum_env.model import Model, Robot, paper_model
from mecanum_env.units import RAD_S_PER_RPM
from sysid.studies.motion import Command, settled_motion, start

FORWARD, LEFT, DIAGONAL = (80.0, 0.0, 0.0), (80.0, 90.0, 0.0), (80.0, 45.0, 0.0)
BUSY = (60.0, 30.0, 20.0)
"""Command of the measurement of speed; all wheels turn."""
TOLERANCE = 0.01
"""Largest difference of the sideways ratio from that at the finest step, as a share of it."""
DRIFT_M = 3.0
"""Length of the drive for which the change of heading is told [m]."""
MOTIONS = (FORWARD, LEFT, DIAGONAL)
OURS = "ours, rollers"
TITLE = "Physics: a Mecanum robot on its wheels"
HEAD = ("model", "sideways, without slip", "forward, without slip", "ripple %", "bounce um", "drift deg",
        "step s", "steps/s", "simulated s per s", "ours over it")  # fmt: skip


@dataclass(frozen=True)
class Contender:
    """A robot's model at any time step, and what its wheels would do without slip."""

    name: str
    compile: Callable[[float], mujoco.MjModel]
    robot: Robot
    """Dimensions behind the ideal kinematics; the wheel's radius is what its publisher would state."""
    ctrl_per_rpm: float
    forward: float
    """Forward ratio to ideal kinematics without slip, on average over a turn of the wheel."""
    sideways: float
    """Sideways ratio, likewise."""


@dataclass(frozen=True)
class Motion:
    """A drive at a constant command, after it has settled."""

    ratio: float
    """Speed along the commanded direction over that of ideal kinematics."""
    ripple: float
    """Standard deviation of that speed, as a share of its mean."""
    bounce_m: float
    """Standard deviation of the height [m]."""
    drift_rad_m: float
    """How far the robot turns for each metre commanded [rad/m]."""


@dataclass(frozen=True)
class Sizes:
    """How much is measured."""

    repeats: int
    """Rounds of the measurement of speed."""
    drive_s: float = 2.0
    """Length of a drive after it has settled [s]."""
    simulated_s: float = 2.0
    """Simulated time of one round [s]."""
    steps_s: tuple[float, ...] = (1 / 120, 1 / 240, 1 / 480, 1 / 960)
    """Time steps that are tried, the largest first [s]."""
    fine_s: float = 1 / 1920
    """Time step of the reference [s]."""


def contenders(model: Model) -> list[Contender]:
    """Return this project's plants and the peers' models, on one robot but for PickNik's own."""
    robot = model.robot

    def own(name: str, make: Callable[..., mujoco.MjSpec]) -> Contender:
        sideways = sideways_ratio(robot.rollers_per_wheel)
        return Contender(
            name, lambda step: make(model, step, visuals=False).compile(), robot, 1.0, 1.0, sideways
        )

    def peer(name: str, made: PeerRobot) -> Contender:
        forward, sideways = no_slip_ratios(made)
        own_radius = replace(made.robot, wheel_radius_m=made.wheel.radius_m)
        return Contender(name, made.compile, own_radius, RAD_S_PER_RPM, forward, sideways)

    stiff = Contact(robot.friction, STIFF)
    soft = Contact(robot.friction, MUJOCO_DEFAULT)
    capsules = capsule_wheel(robot)
    radius = robot.wheel_radius_m
    return [
        own(OURS, robot_spec),
        own("ours, planar", planar_spec),
        peer("spheres, 8 a wheel", PeerRobot(sphere_wheel(radius, 8), stiff, robot)),
        peer("spheres, 20 a wheel", PeerRobot(sphere_wheel(radius, 20), stiff, robot)),
        peer("capsules, stiff contact", PeerRobot(capsules, stiff, robot)),
        peer("capsules, default contact", PeerRobot(capsules, soft, robot)),
        peer("PickNik-like, 8 spheres", picknik_like(8)),
        peer("PickNik-like, 20 spheres", picknik_like(20)),
    ]


def no_slip_ratios(peer: PeerRobot) -> tuple[float, float]:
    """Return the forward and the sideways ratio of a peer's wheel that never slips or leaves the floor.

    The roller at the angle phi holds the wheel along (cos phi, s) on the floor, at the depth reach(phi) below
    the axle, so that a wheel turning at w lets its centre move forward with w reach and sideways with
    w reach cos(phi), which is averaged from one roller to the next.
    """
    p = math.pi / peer.wheel.rollers
    phi = (np.arange(1000) + 0.5) / 1000 * p
    reach = peer.wheel.reach(phi) / peer.wheel.radius_m
    return float(np.mean(reach)), float(np.mean(reach * np.cos(phi)))


def drive(contender: Contender, mj_model: mujoco.MjModel, command: Command, seconds: float) -> Motion:
    """Drive at one command for a second, and measure for `seconds` after it.

    All figures are NaN if the physics diverged.
    """
    ctrl = contender.ctrl_per_rpm * command_to_wheels(*command)
    data, velocities, heights = settled_motion(mj_model, ctrl, seconds)
    if not np.all(np.isfinite(velocities)) or any(warning.number for warning in data.warning):
        return Motion(math.nan, math.nan, math.nan, math.nan)
    ideal = command_to_twist(*command, contender.robot)
    speed = float(np.hypot(*ideal[:2]))
    along = velocities[:, :2] @ ideal[:2] / speed
    mean = float(along.mean())
    return Motion(
        ratio=mean / speed,
        ripple=float(along.std() / abs(mean)) if mean else math.inf,
        bounce_m=float(heights.std()),
        drift_rad_m=abs(float(velocities[:, 2].mean())) / speed,
    )


def fitting_step(contender: Contender, sizes: Sizes) -> tuple[float, Motion]:
    """Return the largest of the time steps that keeps the sideways ratio, and the drive at the fine one.

    If none does, it is the fine step.
    """
    fine = drive(contender, contender.compile(sizes.fine_s), LEFT, sizes.drive_s)
    for step in sizes.steps_s:
        found = drive(contender, contender.compile(step), LEFT, sizes.drive_s)
        if abs(found.ratio / fine.ratio - 1.0) <= TOLERANCE:
            return step, fine
    return sizes.fine_s, fine


def stepper(contender: Contender, step_s: float, simulated_s: float) -> Callable[[], float]:
    """Return what simulates a busy drive for some seconds and returns simulated seconds per second."""
    mj_model = contender.compile(step_s)
    data = start(mj_model)
    data.ctrl[:] = contender.ctrl_per_rpm * command_to_wheels(*BUSY)
    steps = round(simulated_s / step_s)
    mujoco.mj_step(mj_model, data, nstep=steps)

    def play() -> float:
        begin = time.process_time()
        mujoco.mj_step(mj_model, data, nstep=steps)
        return simulated_s / (time.process_time() - begin)

    return play


def measure(sizes: Sizes) -> Table:
    """Measure motion and speed of all models; speed by turns."""
    robots = contenders(paper_model())
    steps, fine, motions = {}, {}, {}
    for robot in tqdm(robots, desc="physics, motion", unit="model", disable=None):
        steps[robot.name], fine[robot.name] = fitting_step(robot, sizes)
        compiled = robot.compile(steps[robot.name])
        motions[robot.name] = [
            drive(robot, compiled, one, sizes.drive_s) for one in (FORWARD, LEFT, DIAGONAL)
        ]
    plays = {robot.name: stepper(robot, steps[robot.name], sizes.simulated_s) for robot in robots}
    rates: dict[str, list[float]] = {robot.name: [] for robot in robots}
    for _ in tqdm(range(sizes.repeats), desc="physics, speed", unit="round", disable=None):
        for name, play in plays.items():
            rates[name].append(play())
    return table(robots, steps, fine, motions, rates)


def table(
    robots: Sequence[Contender],
    steps: Mapping[str, float],
    fine: Mapping[str, Motion],
    motions: Mapping[str, Sequence[Motion]],
    rates: Mapping[str, Sequence[float]],
) -> Table:
    """Return the table of measured motions (forward, sideways, diagonal) and simulated seconds per second."""
    cells, figures = [], {}
    for robot in robots:
        name = robot.name
        forward, left, _ = motions[name]
        drift = max(motion.drift_rad_m for motion in motions[name])
        step, rate = steps[name], spread(rates[name])
        cells.append(
            (
                name,
                f"{left.ratio:.3f}, {robot.sideways:.3f}",
                f"{forward.ratio:.3f}, {robot.forward:.3f}",
                f"{left.ripple * 100:.1f}",
                f"{max(forward.bounce_m, left.bounce_m) * 1e6:.0f}",
                f"{math.degrees(drift) * DRIFT_M:.2f}",
                f"1/{1 / step:.0f}",
                number(rate.median / step),
                str(rate),
                str(over(rates[OURS], rates[name])),
            )
        )
        figures[name] = {
            "timestep_s": step,
            "sideways": left.ratio,
            "sideways_fine": fine[name].ratio,
            "sideways_without_slip": robot.sideways,
            "forward": forward.ratio,
            "forward_without_slip": robot.forward,
            "ripple": left.ripple,
            "bounce_m": max(forward.bounce_m, left.bounce_m),
            "drift_rad": drift * DRIFT_M,
            "simulated_s_per_s": list(rates[name]),
        }
    faster = [
        f"{robot.name} simulates more seconds a second than our rollers; sideways it reaches "
        f"{motions[robot.name][1].ratio:.3f}, where its own geometry without slip gives {robot.sideways:.3f}."
        for robot in robots
        if not robot.name.startswith("ours") and over(rates[robot.name], rates[OURS]).median > 1.0
    ]
    return Table(TITLE, _ABOUT, HEAD, tuple(cells), figures, tuple(faster))


_ABOUT = f"""\
Wheel commands of 80 rpm forward, sideways and at 45 degrees, for two seconds after the first. *Sideways*
and *forward*: speed over that of ideal kinematics, and what the geometry of the rollers gives without slip,
on average. *Ripple*: standard deviation of the sideways speed. *Bounce*: that of the height, the larger of
both drives. *Drift*: change of heading over {DRIFT_M:g} m, the largest of the three. *Step*: the largest of
1/120, 1/240, 1/480, 1/960 s with which the sideways ratio is within {TOLERANCE:.0%} of that at 1/1920 s; all
other figures are at this step (our own default is 1/480 s). *Simulated s per s* is by processor time, all
four wheels turning, rounds by turns: median (least .. largest).

The peers' wheels stand on this robot's chassis, with its mass, servo and friction, and a rocker, so that
wheels, contact settings and solver settings alone differ. Sphere wheels are those of PickNik's
[hangar_sim](https://github.com/PickNikRobotics/moveit_pro_example_ws), 8 a wheel until
[August 2026](https://github.com/PickNikRobotics/moveit_pro_example_ws/pull/875) and 20 since, with its
contact settings; capsules have the length with which the wheel is roundest. *PickNik-like* has all of its
published numbers, a chassis on planar joints included, but is held where its wheels always touch. These
models are ours, written after the descriptions. As a check, the rolling radius of PickNik-like with 20
spheres, 0.992 of 75.9 mm, is the 75.3 mm that its authors
[measured](https://github.com/PickNikRobotics/moveit_pro_example_ws/pull/913)."""
