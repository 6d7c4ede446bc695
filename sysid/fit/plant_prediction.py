"""What a model predicts for robot logs: the whole robot simulated on the logs' own commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mecanum_env.mjcf import planar_spec, robot_spec
from mecanum_env.model import Model
from mecanum_env.simulator import RobotPlant, drive
from mecanum_env.units import FloatArray
from sysid.compare.prediction import commands_of
from sysid.logs import Run

BODY_VELOCITY = ("vx_m_s", "vy_m_s", "yaw_rate_rad_s")


@dataclass(frozen=True)
class PlantData:
    """Robot logs to predict: runs that start at rest, and the channels that count."""

    runs: tuple[Run, ...]
    channels: tuple[str, ...]
    sigma: Mapping[str, float]
    """Noise of each channel, in its unit."""
    sigma_known: bool = True
    """The noise is from repeats; False: it is what an earlier fit left over, at most."""

    def spread(self, model: Model) -> float:
        """Return the rms over the noise that a model leaves on the planar plant."""
        return float(np.sqrt(np.mean((self.predicted(model) - self.measured()) ** 2)))

    def variance(self, cost: float, samples: int, parameters: int = 0) -> float:
        """Return the residual variance over the noise's, for half the square sum `cost` of `samples`.

        A residual above the noise is error of the model, and no parameter is surer than that leaves it; one
        below known noise is luck.
        """
        ratio = 2.0 * cost / max(1, samples - parameters)
        return max(1.0, ratio) if self.sigma_known else max(ratio, 1e-300)

    def measured(self) -> FloatArray:
        """Return all finite samples over their noise, run by run and channel by channel, shape (M,)."""
        return np.concatenate(
            [
                run.channel(name)[run.finite(name)] / self.sigma[name]
                for run in self.runs
                for name in self.channels
                if name in run.channels
            ]
        )

    def predicted(self, model: Model, plant: RobotPlant = "planar") -> FloatArray:
        """Return what a model predicts for `measured`, shape (M,).

        Args:
            model: wheel and robot.
            plant: "planar" (no slip, fast) or "rollers".
        """
        spec = planar_spec if plant == "planar" else robot_spec
        compiled = spec(model, wheel_quantum=False, visuals=False).compile()
        parts = []
        for run in self.runs:
            path = drive(
                model,
                commands_of(run, model.wheel.command_period_s),
                run.duration_s,
                plant=plant,
                mj_model=compiled,
            )
            channels = path.channels_at(run.time_s)
            parts += [
                channels[name][run.finite(name)] / self.sigma[name]
                for name in self.channels
                if name in run.channels
            ]
        return np.concatenate(parts)


def largest_command_runs(runs: Sequence[Run], seconds: float) -> tuple[Run, ...]:
    """Return runs up to so many seconds altogether, those of the largest commands first, at least one."""
    chosen: list[Run] = []
    for run in sorted(runs, key=lambda run: -float(np.sqrt(np.mean(run.command.wheels_rpm**2)))):
        if not chosen or sum(r.duration_s for r in chosen) + run.duration_s <= seconds:
            chosen.append(run)
    return tuple(chosen)
