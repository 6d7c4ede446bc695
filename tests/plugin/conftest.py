"""Models with wheel drives on free hinges, and what drives them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from mecanum_env.law import LawState, WheelLaw
from mecanum_env.model import Model, Robot, Wheel
from mecanum_env.plugin.layout import set_wheel_parameters
from mecanum_env.wheel_drive.drive import EPS, RING
from mecanum_env.wheel_drive.inputs import Latched, latched, ramped_inputs
from mecanum_env.wheel_drive.ramp import Ramp

Build = Callable[..., mujoco.MjSpec]


@pytest.fixture(scope="session")
def wheels_spec() -> Build:
    """Return a builder of a spec: `n` free wheels with drives "wheel_0" ..., or native velocity servos."""

    def build(model: Model, n: int = 1, timestep: float = 1 / 480, native: bool = False) -> mujoco.MjSpec:
        spec = mujoco.MjSpec()
        spec.option.timestep = timestep
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.gravity = [0.0, 0.0, 0.0]
        for i in range(n):
            body = spec.worldbody.add_body(name=f"hub_{i}", pos=[0.0, i, 0.0])
            body.add_joint(name=f"wheel_{i}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 1.0, 0.0])
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[0.0762, 0.02, 0.0], mass=1.0)
            actuator = spec.add_actuator(name=f"wheel_{i}", target=f"wheel_{i}")
            actuator.trntype = mujoco.mjtTrn.mjTRN_JOINT
            if native:
                servo, limit = model.robot.servo_n_m_s_rad, model.robot.torque_limit_n_m
                actuator.gainprm = [servo] + [0.0] * 9
                actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
                actuator.biasprm = [0.0, 0.0, -servo] + [0.0] * 7
                actuator.forcerange = [-limit, limit]
            else:
                set_wheel_parameters(spec, actuator, model)
        return spec

    return build


@pytest.fixture(scope="session")
def compile_wheels(wheels_spec: Build) -> Callable[..., mujoco.MjModel]:
    """Return a builder of compiled models, arguments as `wheels_spec`."""
    return lambda *args, **kwargs: wheels_spec(*args, **kwargs).compile()


def random_law(rng: np.random.Generator, sample_period_s: float = 1 / 120) -> WheelLaw:
    """Return a stable law of unit gain with random poles, real or in pairs, up to 0.95."""
    radius, angle, pole = rng.uniform(0.0, 0.95), rng.uniform(0.0, np.pi), rng.uniform(-0.95, 0.95)
    pair = radius * np.exp(1j * angle)
    _, a, b, c = -np.poly([pair, pair.conjugate(), pole]).real
    d, f = rng.uniform(-0.2, 0.2, 2)
    return WheelLaw(a, b, c, d, 0.0, f, sample_period_s).normalised()


@pytest.fixture(scope="session")
def stable_law() -> Callable[..., WheelLaw]:
    """Return `random_law`."""
    return random_law


@pytest.fixture
def free_model(paper: Model) -> Callable[..., Model]:
    """Return a builder of the paper's model with other wheel and robot values, or a delay."""

    def build(delay_s: float = 0.0, **values: object) -> Model:
        wheel = {name: value for name, value in values.items() if name in Wheel.__dataclass_fields__}
        robot = {name: value for name, value in values.items() if name in Robot.__dataclass_fields__}
        assert len(wheel) + len(robot) == len(values)
        model = replace(paper, wheel=replace(paper.wheel, **wheel), robot=replace(paper.robot, **robot))
        return model.with_effect("command_latency", delay_s=delay_s) if delay_s else model

    return build


@pytest.fixture
def in_tmp_path(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Work in a temporary folder: MuJoCo writes its warnings to a file in the working folder."""
    monkeypatch.chdir(tmp_path)


class SteppedDrive:
    """The drives of wheels of one kind, one substep after the other, as the plugin steps them.

    It starts at rest, or settled at constant commands `steady_rpm`, shape (...).
    """

    def __init__(self, parameters, timestep, steady_rpm=0.0):
        self.parameters, self.timestep = parameters, timestep
        speed = np.asarray(steady_rpm, float)
        self.substeps = self.ticks = self.latches = 0
        self.law, self.ramp, self.excess = LawState.steady(speed), Ramp.steady(speed), np.zeros(speed.shape)
        self.latched = Latched.steady(speed, RING)

    def step(self, command_rpm, lost_v=0.0):
        """Advance one substep with these commands, shape (...); return the setpoint [rpm] at its end.

        The supply has lost `lost_v` [V] by now.
        """
        parameters, now = self.parameters, self.substeps * self.timestep
        tau, period = parameters.law.sample_period_s, parameters.command_period_s
        while now >= self.latches * period - EPS * period:
            sent = np.asarray(command_rpm, float)[..., None]
            new = latched(parameters, sent, self.latches, self.latched, lost_v)
            self.latched = self.latched.followed_by(new).last(RING)
            self.latches += 1
        while now >= self.ticks * tau - EPS * tau:
            first = self.latches - RING
            r, self.ramp = ramped_inputs(
                parameters, [self.ticks], self.latched, self.latches, first, self.ramp
            )
            self.law, self.excess = parameters.motor_bounds.tick(
                parameters.law, self.law, r[..., 0], self.excess, lost_v
            )
            self.ticks += 1
        self.substeps += 1
        w0, w1 = np.asarray(self.law.w0, float), np.asarray(self.law.w1, float)
        share = (self.substeps * self.timestep - (self.ticks - 1) * tau) / tau
        return w1 + (w0 - w1) * min(max(share, 0.0), 1.0)


@pytest.fixture(scope="session")
def stepped_drive() -> type[SteppedDrive]:
    """Return the class of drives that are stepped one substep after the other."""
    return SteppedDrive
