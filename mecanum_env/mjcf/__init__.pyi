from .physics import SIMULATION_TIMESTEP_S, TRAINING_TIMESTEP_S, Drive, fitting_timestep
from .plants import bench_spec, planar_spec, robot_spec, write_models

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
