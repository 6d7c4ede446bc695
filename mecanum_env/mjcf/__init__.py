"""The MuJoCo models of a `mecanum_env.model.Model`: robot on rollers, planar plant, bench."""

from __future__ import annotations

from mecanum_env.mjcf.drive import Drive
from mecanum_env.mjcf.physics import SIMULATION_TIMESTEP_S, TRAINING_TIMESTEP_S, fitting_timestep
from mecanum_env.mjcf.plants import bench_spec, planar_spec, robot_spec

__all__ = [
    "SIMULATION_TIMESTEP_S",
    "TRAINING_TIMESTEP_S",
    "Drive",
    "bench_spec",
    "fitting_timestep",
    "planar_spec",
    "robot_spec",
]
