"""Limits on the robot's command as a whole, between its latch and the wheels' drives.

A wheel's drive cannot apply a limit on V, theta and VC together. It acts continuously, after latch, rounding
and latency, and the drives take the mean of what it lets through over each tick of the wheel law.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.apply import active_effects, drive_parameters
from mecanum_env.kinematics import WHEELS, body_to_wheels, wheels_to_body
from mecanum_env.law.drive import EPS, RING, law_inputs
from mecanum_env.model import Model
from mecanum_env.units import FloatArray


def limits_body(model: Model) -> bool:
    """Return whether a model limits the robot's command as a whole."""
    return any(effect.limit_body is not None for effect, _ in active_effects(model))


def wheel_side(model: Model) -> Model:
    """Return the model of what comes after the limits: drives that take a command at each tick, as it is."""
    wheel = replace(model.wheel, command_period_s=model.wheel.law.sample_period_s, command_quantum_rpm=0.0)
    before = ("command", "body_command")
    left = {name: v for name, v in model.effects.items() if CATALOGUE[name].station not in before}
    return replace(model, wheel=wheel, effects=left)


class BodyLimits:
    """What becomes of wheel commands that go through the limits, one physics step after the other.

    The wheels' part that the body cannot follow (wheels working against each other) passes unchanged.

    Args:
        model: its latch, its latency and its limits count.
        timestep_s: of the physics.
    """

    def __init__(self, model: Model, timestep_s: float) -> None:
        self._drive = drive_parameters(model)
        self._limits = [
            (effect.limit_body, values) for effect, values in active_effects(model) if effect.limit_body
        ]
        self._timestep_s = timestep_s
        self._substeps = self._ticks = self._latches = 0
        self._latched = np.zeros((len(WHEELS), RING))
        self._body = np.zeros(3)
        self._wheels = np.zeros(len(WHEELS))

    def step(self, wheels_rpm: FloatArray) -> FloatArray:
        """Return what the drives get in this physics step, shape (4,) [rpm].

        Args:
            wheels_rpm: what the robot is sent now, rounded, shape (4,).
        """
        now = self._substeps * self._timestep_s
        period, tau = self._drive.command_period_s, self._drive.law.sample_period_s
        while now >= self._latches * period - EPS * period:
            self._latched = np.concatenate([self._latched[:, 1:], wheels_rpm[:, None]], axis=1)
            self._latches += 1
        while now >= self._ticks * tau - EPS * tau:
            start = self._latches - RING
            self._tick(law_inputs(self._drive, [self._ticks], self._latched, self._latches, start)[:, 0])
            self._ticks += 1
        self._substeps += 1
        return self._wheels

    def path(self, wheels_rpm: FloatArray) -> FloatArray:
        """Return what `step` would, from the start, for all physics steps at once, shape (n, 4) [rpm].

        Args:
            wheels_rpm: what the robot is sent, shape (n, 4).
        """
        now = np.arange(len(wheels_rpm), dtype=float) * self._timestep_s
        period, tau = self._drive.command_period_s, self._drive.law.sample_period_s
        latched_at, ticked_at = (_due(now, each) for each in (period, tau))
        before = np.zeros((len(WHEELS), RING))
        latched = np.concatenate([before, wheels_rpm[latched_at].T], axis=1)
        latches = np.searchsorted(latched_at, ticked_at, side="right")
        asked = law_inputs(self._drive, np.arange(ticked_at.size), latched, latches, -RING).T.copy()
        let_through = np.zeros((ticked_at.size, len(WHEELS)))
        for tick in range(ticked_at.size):
            self._tick(asked[tick])
            let_through[tick] = self._wheels
        return let_through[np.searchsorted(ticked_at, np.arange(len(wheels_rpm)), side="right") - 1]

    def _tick(self, asked_rpm: FloatArray) -> None:
        body = wheels_to_body(asked_rpm)
        inner = asked_rpm - body_to_wheels(body)
        mean = body
        for limit, values in self._limits:
            body, mean = limit(body, self._body, values, self._drive.law.sample_period_s)
        self._body = body
        self._wheels = body_to_wheels(mean) + inner


def _due(now_s: FloatArray, every_s: float) -> npt.NDArray[np.intp]:
    """Return the physics steps, at times (n,), in which what happens every so often happens, first at 0."""
    times = np.arange(np.ceil(now_s[-1] / every_s + 1.0)) if now_s.size else np.zeros(0)
    steps = np.searchsorted(now_s, times * every_s - EPS * every_s)
    return steps[steps < now_s.size]
