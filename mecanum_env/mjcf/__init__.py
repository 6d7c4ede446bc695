"""The MuJoCo models of a `mecanum_env.model.Model`: robot on rollers, planar plant, bench."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mecanum_env.lazy import lazy_exports

if TYPE_CHECKING:
    from mecanum_env.mjcf.physics import SIMULATION_TIMESTEP_S, TRAINING_TIMESTEP_S, Drive, fitting_timestep
    from mecanum_env.mjcf.plants import bench_spec, planar_spec, robot_spec, write_models
else:
    __getattr__, __dir__ = lazy_exports(__name__, __file__)

__all__ = [
    "SIMULATION_TIMESTEP_S",
    "TRAINING_TIMESTEP_S",
    "Drive",
    "bench_spec",
    "fitting_timestep",
    "planar_spec",
    "robot_spec",
    "write_models",
]
