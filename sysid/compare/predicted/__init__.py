"""What a model predicts for logs: their commands simulated, as the model's sensors see the motion."""

from sysid.compare.predicted.gap_start import START_PRICE
from sysid.compare.predicted.prediction import motion_of, predict, predict_all, readings
from sysid.compare.predicted.settings import SimulationSettings
from sysid.compare.predicted.simulator import (
    MIDDLE,
    Averaged,
    Simulator,
    Simulators,
    Starts,
    model_key,
    planar_part,
    without_engine_warnings,
)

__all__ = [
    "MIDDLE",
    "START_PRICE",
    "Averaged",
    "SimulationSettings",
    "Simulator",
    "Simulators",
    "Starts",
    "model_key",
    "motion_of",
    "planar_part",
    "predict",
    "predict_all",
    "readings",
    "without_engine_warnings",
]
