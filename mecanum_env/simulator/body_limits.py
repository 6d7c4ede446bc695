"""Limits on the robot's command as a whole (V, theta, VC), which no single wheel's drive can apply.

They act after latch, rounding and latency and before the drives, which receive the mean of the limited
command over each tick of the wheel law.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.apply import active_effects, drive_parameters
from mecanum_env.effects.definition import BodyCommand
from mecanum_env.kinematics import WHEELS, body_to_wheels, wheels_to_body
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.drive import EPS, RING, DriveParameters
from mecanum_env.wheel_drive.inputs import Latched, latched, law_inputs

_MIXING: Final = body_to_wheels(np.eye(3))  # (3, 4)


def limits_body(model: Model) -> bool:
    """Return whether a model limits the robot's command as a whole."""
    return any(effect.limit_body is not None for effect, _ in active_effects(model))


def wheel_side(model: Model) -> Model:
    """Return the model of what comes after the limits: drives that take a command at each tick, as it is."""
    wheel = replace(model.wheel, command_period_s=model.wheel.law.sample_period_s, command_quantum_rpm=0.0)
    before = ("command", "body_command")
    left = {name: v for name, v in model.effects.items() if CATALOGUE[name].station not in before}
    return replace(model, wheel=wheel, effects=left)


def behind_limits(model: Model) -> Model:
    """Return the model that the plant simulates: of the drives alone where limits on the body come before."""
    return wheel_side(model) if limits_body(model) else model


class BodyLimits:
    """Wheel commands sent to a robot -> limited wheel commands of its drives, physics step by physics step.

    The part of the wheel commands that no body motion follows (wheels working against each other) passes
    unchanged. Chance of the link, its jitter and loss, follows from `link_seed`; None: the model's.
    """

    def __init__(self, model: Model, timestep_s: float, link_seed: int | None = None) -> None:
        drive = drive_parameters(model)
        # The link alone; what shapes the wheels' commands comes behind the limits.
        self._drive = DriveParameters(
            drive.law,
            drive.command_period_s,
            delay_s=drive.delay_s,
            jitter_s=drive.jitter_s,
            loss=drive.loss,
            link_seed=drive.link_seed if link_seed is None else link_seed,
        )
        self._limits = [
            (effect.limit_body, values) for effect, values in active_effects(model) if effect.limit_body
        ]
        self._timestep_s = timestep_s
        self._substeps = self._ticks = self._latches = 0
        self._latched = Latched.steady(np.zeros(len(WHEELS)), RING)
        self._body: BodyCommand = (0.0, 0.0, 0.0)
        self._wheels = np.zeros(len(WHEELS))

    def step(self, wheels_rpm: FloatArray) -> FloatArray:
        """Return the drives' commands [rpm] in the next physics step for rounded ones sent now, (4,) each."""
        now = self._substeps * self._timestep_s
        period, tau = self._drive.command_period_s, self._drive.law.sample_period_s
        while now >= self._latches * period - EPS * period:
            new = latched(self._drive, wheels_rpm[:, None], self._latches, self._latched)
            self._latched = self._latched.followed_by(new).last(RING)
            self._latches += 1
        while now >= self._ticks * tau - EPS * tau:
            start = self._latches - RING
            asked = law_inputs(self._drive, [self._ticks], self._latched, self._latches, start)[:, 0]
            self._tick(*_parts(asked))
            self._ticks += 1
        self._substeps += 1
        return self._wheels

    def path(self, wheels_rpm: FloatArray) -> FloatArray:
        """Return the drives' commands [rpm] in all physics steps for rounded ones sent, (n, 4) each.

        The result equals that of n calls of `step` from the start.
        """
        self._body = (0.0, 0.0, 0.0)
        now = np.arange(len(wheels_rpm), dtype=float) * self._timestep_s
        period, tau = self._drive.command_period_s, self._drive.law.sample_period_s
        latched_at, ticked_at = (_due(now, each) for each in (period, tau))
        before = Latched.steady(np.zeros(len(WHEELS)), RING)
        commands = before.followed_by(latched(self._drive, wheels_rpm[latched_at].T, 0, before))
        latches = np.searchsorted(latched_at, ticked_at, side="right")
        asked = law_inputs(self._drive, np.arange(ticked_at.size), commands, latches, -RING).T.copy()
        same = np.append(False, np.all(asked[1:] == asked[:-1], axis=1))
        means, opposed = list[BodyCommand](), np.zeros((ticked_at.size, len(WHEELS)))
        for tick, unchanged in enumerate(same.tolist()):
            if not unchanged:
                body, others, settled = *_parts(asked[tick]), False
            if not settled:
                last, mean = self._body, self._limited(body)
                # The next tick would start where this one did: while the command stays, so do the wheels.
                settled = unchanged and self._body == last
            means.append(mean)
            opposed[tick] = others
        limited = _wheels_of(np.array(means)) + opposed
        return limited[np.searchsorted(ticked_at, np.arange(len(wheels_rpm)), side="right") - 1]

    def _tick(self, body: BodyCommand, opposed_rpm: FloatArray) -> None:
        """Limit the body's command of one tick of the wheel law; the rest of the wheels' passes, (4,)."""
        self._wheels = _wheels_of(np.array(self._limited(body))) + opposed_rpm

    def _limited(self, body: BodyCommand) -> BodyCommand:
        """Limit the body's command of one tick; return its mean over the tick."""
        mean = body
        for limit, values in self._limits:
            body, mean = limit(body, self._body, values, self._drive.law.sample_period_s)
        self._body = body
        return mean


def _wheels_of(bodies_rpm: FloatArray) -> FloatArray:
    """Return what `body_to_wheels` does, with the same bits for one body as for many."""
    forward, left, turn = (bodies_rpm[..., i, None] for i in range(3))
    return np.asarray(forward * _MIXING[0] + left * _MIXING[1] + turn * _MIXING[2])


def _parts(wheels_rpm: FloatArray) -> tuple[BodyCommand, FloatArray]:
    """Return the body's command in wheel commands [rpm], (4,), and what no body motion follows, (4,)."""
    body = wheels_to_body(wheels_rpm)
    forward, left, turn = body.tolist()
    return (forward, left, turn), wheels_rpm - body_to_wheels(body)


def _due(now_s: FloatArray, every_s: float) -> npt.NDArray[np.intp]:
    """Return the physics steps, at times (n,), in which an event of period `every_s` occurs, first at 0."""
    times = np.arange(np.ceil(now_s[-1] / every_s + 1.0)) if now_s.size else np.zeros(0)
    steps = np.searchsorted(now_s, times * every_s - EPS * every_s)
    return steps[steps < now_s.size]
