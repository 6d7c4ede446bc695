"""Mecanum robots as others model them in MuJoCo, written anew from the published descriptions.

A wheel's rollers are spheres on hinges in PickNik's `hangar_sim`
(github.com/PickNikRobotics/moveit_pro_example_ws), with 8 spheres a wheel until pull request 875 of August
2026 and 20 since; its chassis rides on planar joints at a fixed height. In models of hobby robots, for Webots
for one, the rollers are capsules on hinges.

`sphere_wheel` and `capsule_wheel` make wheels for the chassis of this project's robot (mass, dimensions,
servo, rocker, friction), so that the wheels differ; `picknik_like` has the published numbers throughout.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import mujoco
import numpy as np

from mecanum_env.kinematics import WHEELS
from mecanum_env.mjcf.geometry import ROLLER_SIDE, wheel_geometry, wheel_position
from mecanum_env.model import Robot
from mecanum_env.units import FloatArray

_PHASE_SHARE = {"fl": 0.0, "fr": 0.5, "rl": 0.5, "rr": 0.0}
"""Angle of each wheel's first roller over that between rollers: diagonal pairs alternate."""


@dataclass(frozen=True)
class RollerWheel:
    """A wheel whose rollers, spheres or capsules, turn on axes at 45 degrees to the axle."""

    rollers: int
    circle_m: float
    """Radius of the circle of the rollers' centres [m]."""
    roller_radius_m: float
    half_length_m: float = 0.0
    """Half the length of a capsule's cylinder [m]; 0: a sphere."""

    @property
    def radius_m(self) -> float:
        """Radius [m] below the middle of a roller, which its publisher would call the wheel's."""
        return self.circle_m + self.roller_radius_m

    def reach(self, phi: FloatArray) -> FloatArray:
        """Return how far [m] the roller at `phi` [rad] from the lowest point reaches below the axle."""
        end = self.half_length_m * np.abs(np.sin(phi)) / math.sqrt(2.0)
        return np.asarray(self.circle_m * np.cos(phi) + end + self.roller_radius_m)


def sphere_wheel(radius_m: float, rollers: Literal[8, 20]) -> RollerWheel:
    """Return PickNik's wheel, scaled to a radius [m]: 8 small spheres apart, or 20 that touch each other."""
    if rollers == 8:
        return RollerWheel(8, radius_m * 59.4 / 75.9, radius_m * 16.5 / 75.9)
    sine = math.sin(math.pi / rollers)
    return RollerWheel(rollers, radius_m / (1.0 + sine), radius_m * sine / (1.0 + sine))


def capsule_wheel(robot: Robot) -> RollerWheel:
    """Return a wheel of capsules, with as many and as thick rollers as this robot's own.

    The length is that with which a capsule's end, where the load passes to the next one, is as low as its
    middle; with any other the wheel bumps more.
    """
    own = wheel_geometry(robot.wheel_radius_m, robot.rollers_per_wheel)
    p = math.pi / own.rollers
    half_length = math.sqrt(2.0) * own.roller_circle * math.tan(p / 2)
    return RollerWheel(own.rollers, own.roller_circle, own.roller_radius, half_length)


@dataclass(frozen=True)
class Contact:
    """Floor contact of rollers, as MJCF states it."""

    friction: float
    solref: tuple[float, float]
    condim: int = 3
    solimp: tuple[float, float, float, float, float] = (0.9, 0.95, 0.001, 0.5, 2.0)


MUJOCO_DEFAULT = (0.02, 1.0)
"""MuJoCo's own `solref`."""
STIFF = (0.002, 1.0)
"""The `solref` of `hangar_sim`."""


@dataclass(frozen=True)
class PeerRobot:
    """A robot on four roller wheels with velocity servos."""

    wheel: RollerWheel
    contact: Contact
    robot: Robot
    """Dimensions, mass, yaw inertia and servo; its wheel's geometry is not used."""
    planar: bool = False
    """Whether the chassis slides at the height of the wheels' lowest reach instead of standing on them."""
    roller_damping: float = 1e-5
    """Damping of each roller [N m s/rad]."""
    wheel_armature: float = 0.0
    """Rotor inertia of each drive [kg m^2]."""
    wheel_damping: float = 0.0
    """Damping of each axle [N m s/rad]."""
    noslip_iterations: int = 0
    impratio: float = 1.0

    def compile(self, timestep_s: float) -> mujoco.MjModel:
        """Return the model with a physics step [s]; `ctrl` is wheel speeds fl, fr, rl, rr [rad/s]."""
        return self.spec(timestep_s).compile()

    def spec(self, timestep_s: float) -> mujoco.MjSpec:
        """Return the spec; names of body, site, joints, actuators and sensors are those of `robot_spec`."""
        spec = mujoco.MjSpec()
        spec.compiler.autolimits = True
        spec.option.timestep = timestep_s
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.noslip_iterations = self.noslip_iterations
        spec.option.impratio = self.impratio
        spec.worldbody.add_geom(
            name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[20, 20, 0.1], contype=2, conaffinity=1
        )
        front = self._add_chassis(spec)
        for name in WHEELS:
            x, y = wheel_position(self.robot, name)
            self._add_wheel(spec, front if name[0] == "f" else spec.body("base"), name, (x, y))
        for name, kind in (
            ("base_velocity", mujoco.mjtSensor.mjSENS_VELOCIMETER),
            ("base_gyro", mujoco.mjtSensor.mjSENS_GYRO),
        ):
            spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="base")
        return spec

    def _add_chassis(self, spec: mujoco.MjSpec) -> mujoco.MjsBody:
        """Add the body "base" and return what carries the front wheels: a rocker, or the base itself."""
        robot, wheel = self.robot, self.wheel
        lowest = float(wheel.reach(np.array(math.pi / wheel.rollers)))
        base = spec.worldbody.add_body(name="base", pos=[0, 0, lowest if self.planar else wheel.radius_m])
        base.add_site(name="base")
        yaw = robot.yaw_inertia_kg_m2
        base.explicitinertial = True
        base.mass, base.inertia = 0.9 * robot.mass_kg, [0.35 * yaw, 0.35 * yaw, 0.6 * yaw]
        base.ipos = [0, 0, 0.6 * wheel.radius_m]
        base.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[robot.half_wheelbase_m, 0.7 * robot.half_track_m, 0.3 * wheel.radius_m],
            pos=[0, 0, 0.8 * wheel.radius_m],
            contype=0,
            conaffinity=0,
            rgba=[0.5, 0.6, 0.7, 0.6],
        )
        if self.planar:
            for name, kind, axis in (
                ("base_x", mujoco.mjtJoint.mjJNT_SLIDE, [1, 0, 0]),
                ("base_y", mujoco.mjtJoint.mjJNT_SLIDE, [0, 1, 0]),
                ("base_yaw", mujoco.mjtJoint.mjJNT_HINGE, [0, 0, 1]),
            ):
                damping = 1.0 if name == "base_yaw" else 0.5
                base.add_joint(name=name, type=kind, axis=axis, damping=damping)
            return base
        base.add_joint(name="base", type=mujoco.mjtJoint.mjJNT_FREE)
        rocker = base.add_body(name="rocker")
        rocker.add_joint(name="rocker", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[1, 0, 0], range=[-0.2, 0.2])
        rocker.explicitinertial = True
        rocker.mass, rocker.inertia = 0.02 * robot.mass_kg, [0.005, 0.001, 0.005]
        return rocker

    def _add_wheel(
        self, spec: mujoco.MjSpec, parent: mujoco.MjsBody, name: str, place: tuple[float, float]
    ) -> None:
        """Add the wheel fl, fr, rl or rr with its servo to a parent at a place [m]."""
        robot, wheel, joint = self.robot, self.wheel, f"wheel_{name}"
        hub = parent.add_body(name=joint, pos=[*place, 0.0])
        mass = 0.02 * robot.mass_kg
        across = mass * wheel.circle_m**2 / 4
        hub.explicitinertial = True
        hub.mass, hub.inertia = mass, [across, 2 * across, across]
        hub.add_joint(
            name=joint,
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0, 1, 0],
            armature=self.wheel_armature,
            damping=self.wheel_damping,
        )
        for i in range(wheel.rollers):
            self._add_roller(hub, name, i)
        servo = spec.add_actuator(name=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=joint)
        servo.set_to_velocity(kv=robot.servo_n_m_s_rad)
        servo.forcerange = [-robot.torque_limit_n_m, robot.torque_limit_n_m]

    def _add_roller(self, hub: mujoco.MjsBody, name: str, index: int) -> None:
        robot, wheel, contact = self.robot, self.wheel, self.contact
        phi = 2 * math.pi / wheel.rollers * (index + _PHASE_SHARE[name])
        axis = np.array([math.cos(phi), ROLLER_SIDE[name], -math.sin(phi)]) / math.sqrt(2.0)
        centre = [-wheel.circle_m * math.sin(phi), 0.0, -wheel.circle_m * math.cos(phi)]
        roller = hub.add_body(name=f"wheel_{name}_roller_{index}", pos=centre)
        mass = 0.02 * robot.mass_kg / wheel.rollers
        spin = 0.4 * mass * wheel.roller_radius_m**2
        roller.explicitinertial = True
        roller.mass, roller.inertia = mass, [spin, spin, spin]
        roller.add_joint(
            name=roller.name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis, damping=self.roller_damping
        )
        # Rollers touch the floor alone: neighbours that touch each other would brake.
        geom = roller.add_geom(
            contype=1,
            conaffinity=2,
            condim=contact.condim,
            priority=1,
            friction=[contact.friction, 0.005, 0.0001],
            solref=contact.solref,
            solimp=contact.solimp,
            rgba=[0.9, 0.4, 0.1, 1.0] if index == 0 else [0.2, 0.2, 0.2, 1.0],
        )
        if wheel.half_length_m > 0.0:
            ends = np.concatenate([-wheel.half_length_m * axis, wheel.half_length_m * axis])
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_CAPSULE, [wheel.roller_radius_m, 0, 0]
            geom.fromto = ends
        else:
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_SPHERE, [wheel.roller_radius_m, 0, 0]


def picknik_like(rollers: Literal[8, 20]) -> PeerRobot:
    """Return the base of `hangar_sim` with its published numbers and a wheel radius of 75.9 mm.

    The mass (a Ridgeback with an arm) is estimated; on planar joints it changes no steady motion.
    """
    robot = Robot(
        wheel_radius_m=0.0759,
        half_wheelbase_m=0.319,
        half_track_m=0.2755,
        mass_kg=170.0,
        yaw_inertia_kg_m2=20.0,
        servo_n_m_s_rad=500.0,
        torque_limit_n_m=50_000.0,
    )
    contact = Contact(friction=5.0, solref=STIFF, condim=4)
    return PeerRobot(
        sphere_wheel(0.0759, rollers),
        contact,
        robot,
        planar=True,
        roller_damping=0.1,
        wheel_armature=1.0,
        wheel_damping=0.5,
        noslip_iterations=5,
        impratio=20.0,
    )
