"""Logs of a robot that is not the model's, with the same commands as often as a test wants."""

from __future__ import annotations

from functools import cache

import numpy as np

from mecanum_env.model import paper_model
from mecanum_env.simulator import BodyCommands, drive
from sysid.compare.predicted import SimulationSettings
from sysid.logs import BodyCommand, Dataset, Run

MODEL = paper_model()
GAIN = 0.93
"""Of the robot's wheels; that and a latency make it another one than the model."""
PLANAR = SimulationSettings(plant="planar")
NOISE = {"speed_fl_rpm": 0.5, "speed_rr_rpm": 0.5, "vx_m_s": 0.004, "vy_m_s": 0.004, "yaw_rate_rad_s": 0.01}
LENGTH_S = 2.5
HOLD_S = 0.5
"""For how long a command is held."""


@cache
def motion(
    gain: float, sequence: int, length_s: float = LENGTH_S
) -> tuple[BodyCommands, dict[str, np.ndarray]]:
    """Return the commands of a sequence and what a robot with a gain does, at 1 kHz."""
    rng = np.random.default_rng(sequence)
    time, levels = np.arange(0.0, length_s, 0.1), round(length_s / HOLD_S)
    hold = np.minimum((time / HOLD_S).astype(int), levels - 1)
    v, theta = rng.uniform(-100, 100, levels).round(), rng.integers(0, 360, levels)
    vc = rng.uniform(-40, 40, levels)
    v[0] = vc[0] = 0.0
    commands = BodyCommands(time, v[hold], theta[hold].astype(float), vc.round()[hold])
    fine = np.arange(0.0, length_s, 0.001)
    robot = MODEL.with_effect("speed_gain", gain=gain).with_effect("command_latency", delay_s=0.03)
    path = drive(robot, commands, length_s, plant="planar").channels_at(fine)
    return commands, {name: path[name] for name in NOISE}


def logs(
    gain: float,
    sequences: tuple[int, ...],
    seed: int,
    repeats: int = 2,
    late_s: float = 0.0,
    length_s: float = LENGTH_S,
    jitter_s: float = 0.0,
) -> Dataset:
    """Return noisy runs of a robot with a gain; its commands come `late_s` after the first row.

    What follows each command comes another time late, with the standard deviation `jitter_s`.
    """
    rng, runs = np.random.default_rng(seed), []
    stamps = np.arange(0.0, length_s, 0.025)
    for sequence in sequences:
        commands, path = motion(gain, sequence, length_s)
        then = stamps - late_s
        fine = np.arange(path["vx_m_s"].size) * 0.001
        held = np.clip(np.searchsorted(commands.time_s, then + 1e-9, side="right") - 1, 0, None)
        rows = BodyCommand(commands.v_rpm[held], commands.theta_deg[held], commands.vc_rpm[held])
        for repeat in range(repeats):
            late = jitter_s * rng.standard_normal(round(length_s / HOLD_S)) if jitter_s else np.zeros(99)
            seen = then - late[np.minimum((np.maximum(then, 0.0) / HOLD_S).astype(int), late.size - 1)]
            channels = {
                name: np.interp(seen, fine, path[name]) + sigma * rng.standard_normal(stamps.size)
                for name, sigma in NOISE.items()
            }
            name = f"{sequence}_{repeat}.csv"
            runs.append(Run(name, f"{sequence}", "fit", stamps, rows, channels))
    return Dataset(f"logs {seed}", tuple(runs), (), f"seed {seed}")


NOMINAL = logs(GAIN, (1, 2, 3, 4), seed=10)
"""What the model was fitted to."""
