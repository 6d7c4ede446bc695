"""Sensors of the wheels that are earlier or later than those of the body are told before the fit to both."""

import math
from collections.abc import Callable

import pytest

from mecanum_env.model import Model, paper_model
from sysid.compare.predicted import SimulationSettings
from sysid.fit.effects import HeldOut
from sysid.fit.robot.sensor_times import with_sensor_times
from sysid.logs import Dataset


def cost_on(logs: Dataset) -> Callable[[Model], float]:
    held_out = HeldOut.of(logs, SimulationSettings("planar"))
    return lambda model: held_out.whitener.size * held_out.errors(model)[0] ** 2


@pytest.mark.parametrize(
    ("true", "found"),
    [
        # With the delay of the wheels alone known, it is their sensors', or the body is as late, or later.
        ({"sensor_latency/wheels": 0.08}, {"command_latency": 0.0, "sensor_latency/wheels": 0.08}),
        ({"command_latency": 0.08}, {"command_latency": 0.08}),
        (
            {"command_latency": 0.08, "sensor_latency/body": 0.04},
            {"command_latency": 0.08, "sensor_latency/body": 0.04},
        ),
    ],
)
def test_what_is_late_is_found(
    robot_logs: Callable[..., Dataset], true: dict[str, float], found: dict[str, float]
) -> None:
    model = paper_model()
    for name, delay_s in true.items():
        model = model.with_effect(name, delay_s=delay_s)
    start = paper_model().with_effect("command_latency", delay_s=0.08)
    told = with_sensor_times(start, cost_on(robot_logs(model, body=True)))
    assert {name: values["delay_s"] for name, values in told.effects.items()} == pytest.approx(found)


def test_what_cannot_be_simulated_is_never_taken() -> None:
    start = paper_model().with_effect("command_latency", delay_s=0.08)
    assert with_sensor_times(start, lambda model: 1.0 if model is start else math.inf) is start
