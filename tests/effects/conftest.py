"""What the tests of the effects share: short drives with and without them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.effects import CATALOGUE, Effect, PlantKind
from mecanum_env.model import Model, paper_model
from mecanum_env.simulator import BodyCommands, Trajectory, compile_plant, drive, replay_bench
from mecanum_env.simulator.supply import Supply
from mecanum_env.units import FloatArray
from tests.gap.conftest import bench_logs

__all__ = ["bench_logs"]

# Starts, reversals and a diagonal, in less than a second.
ROUND = BodyCommands.from_rows([(0, 70, 0, 0), (0.2, 70, 140, 0), (0.4, 0, 0, -40), (0.6, 20, 45, 10)])
ROUND_S = 0.8
BENCH_TIME = np.arange(0.0, 1.5, 0.01)
FALLING = Supply(np.array([0.0, 0.1, 0.6]), np.array([24.0, 24.0, 22.0]))
BENCH_COMMAND = np.select([BENCH_TIME < 0.4, BENCH_TIME < 0.9], [60.0, -100.0], 10.0)

# Sizes at which a parameter shows clearly, where three quarters of the search range would not do.
CLEAR = {
    ("speed_saturation", "limit_rpm"): 30.0,
    ("speed_saturation/supply", "limit_rpm"): 30.0,
    ("acceleration_limit/drive", "limit_rpm_s"): 300.0,
    ("acceleration_limit/drive", "brake_rpm_s"): 150.0,
    ("low_grip", "friction"): 0.1,
    ("weak_servo", "servo_n_m_s_rad"): 0.5,
    ("body_speed_limit", "v_rpm"): 30.0,
    ("body_speed_limit", "vc_rpm"): 20.0,
    ("command_deadband", "threshold_rpm"): 25.0,
    ("backlash/rest", "slowing_rpm_s"): 500.0,
    **{
        ("static_map", f"knot_{i}_rpm"): knot
        for i, knot in enumerate((-50.0, -20.0, 0.0, 20.0, 50.0, 90.0), 1)
    },
    **{
        ("static_map", f"value_{i}_rpm"): value
        for i, value in enumerate((-40.0, 0.0, 0.0, 9.0, 50.0, 95.0), 1)
    },
}
# Other parameters that are needed for this one to matter.
BESIDE = {
    ("backlash/rest", "slowing_rpm_s"): {"gap_deg": 30.0},
    **{("backlash/spring", shape): {"gap_deg": 30.0} for shape in ("swing_hz", "damping", "friction_deg")},
    ("payload", "height_m"): {"mass_kg": 20.0},
    ("floor_slope", "heading_deg"): {"slope_deg": 5.0},
    ("speed_saturation", "softness_rpm"): {"limit_rpm": 60.0},
    ("speed_saturation/supply", "motor_s"): {"limit_rpm": 60.0},
    ("speed_saturation/supply", "per_volt"): {"limit_rpm": 30.0},
    ("speed_saturation/supply", "windup"): {"limit_rpm": 30.0},
    ("acceleration_limit/drive", "windup"): {"limit_rpm_s": 300.0},
    ("stiction", "stribeck_rpm"): {"breakaway_n_m": 0.5},
    ("acceleration_limit/drive", "brake_rpm_s"): {"limit_rpm_s": 300.0},
    ("coulomb_friction", "answer_s"): {"torque_n_m": 0.5},
    ("coulomb_friction/washed_out", "answer_s"): {"torque_n_m": 0.5},
    ("coulomb_friction/washed_out", "washout_s"): {"torque_n_m": 0.5},
    ("stiction", "answer_s"): {"breakaway_n_m": 0.5},
    ("stiction/washed_out", "stribeck_rpm"): {"breakaway_n_m": 0.5},
    ("stiction/washed_out", "answer_s"): {"breakaway_n_m": 0.5},
    ("stiction/washed_out", "washout_s"): {"breakaway_n_m": 0.5},
    ("viscous_friction", "answer_s"): {"damping_n_m_s_rad": 0.3},
    ("viscous_friction/washed_out", "answer_s"): {"damping_n_m_s_rad": 0.3},
    ("viscous_friction/washed_out", "washout_s"): {"damping_n_m_s_rad": 0.3},
    ("warm_up/friction", "time_constant_s"): {"share": 0.8},
    ("warm_up/cold_friction", "time_constant_s"): {"torque_n_m": 0.5},
    ("torque_ripple", "per_turn"): {"torque_n_m": 0.5},
    ("torque_ripple", "phase_deg"): {"torque_n_m": 0.5},
    **{
        ("torque_ripple/washed_out", shape): {"torque_n_m": 0.5}
        for shape in ("per_turn", "phase_deg", "answer_s", "washout_s")
    },
    ("encoder_eccentricity", "per_turn"): {"share": 0.1},
    ("encoder_eccentricity", "phase_deg"): {"share": 0.1},
    ("sensor_bias/drift", "per_s"): {"vx_m_s": 0.1},
    ("warm_up", "time_constant_s"): {"share": 0.5},
    ("warm_up/cold", "time_constant_s"): {"share": 0.4},
    ("acceleration_limit", "brake_rpm_s"): {"limit_rpm_s": 300.0},
    ("acceleration_limit/s_curve", "brake_rpm_s"): {"limit_rpm_s": 300.0},
}
# Other effects without which this one has nothing to act on.
COMPANIONS = {
    "warm_up/friction": {"coulomb_friction": {"torque_n_m": 0.5}},
}


def clear_value(name: str, parameter: str) -> float:
    """Return a value of a parameter at which its effect is clearly visible."""
    found = next(p for p in CATALOGUE[name].parameters if p.name == parameter)
    low, high = found.bounds
    return CLEAR.get((name, parameter), low + 0.75 * (high - low))


def clear_model(name: str, parameter: str | None = None) -> Model:
    """Return the paper's model with a clearly visible effect, by its first parameter if none is named."""
    parameter = CATALOGUE[name].parameters[0].name if parameter is None else parameter
    beside = BESIDE.get((name, parameter), {})
    model = paper_model().with_effect(name, **beside, **{parameter: clear_value(name, parameter)})
    return replace(model, effects={**model.effects, **COMPANIONS.get(name, {})})


def acting(plant: PlantKind) -> list[Effect]:
    """Return the effects that act on a plant."""
    return [effect for effect in CATALOGUE.values() if effect.acts_in(plant)]


def channels(
    model: Model, plant: PlantKind, commands: BodyCommands = ROUND, duration_s: float = ROUND_S
) -> FloatArray:
    """Return what a log would show, all channels in one array (channels, n)."""
    if plant == "bench":
        battery_v = np.interp(BENCH_TIME, FALLING.time_s, FALLING.voltage_v)
        return replay_bench(model, BENCH_TIME, BENCH_COMMAND, wheel="fl", battery_v=battery_v)[None]
    path = drive(model, commands, duration_s, plant=plant, supply=FALLING)
    return np.array(list(path.channels_at(path.time_s).values()))


@pytest.fixture(scope="session")
def plain() -> Callable[[PlantKind], FloatArray]:
    """Return the channels without any effect, by plant."""
    known = {plant: channels(paper_model(), plant) for plant in ("bench", "rollers", "planar")}
    return known.__getitem__


@pytest.fixture(scope="session")
def base() -> Model:
    """Return the packaged model, read once."""
    return paper_model()


@pytest.fixture(scope="session")
def steady() -> Callable[..., Trajectory]:
    """Return a drive of a constant command."""

    def of(model: Model, *command: float, seconds: float = 1.5, plant: PlantKind = "rollers") -> Trajectory:
        return drive(
            model, BodyCommands.constant(*command), seconds, plant=plant, mj_model=compile_plant(model, plant)
        )

    return of
