"""How late a robot's sensors are beside each other: a start for the fit to all of its channels.

The wheels tell the delay of the command and of their own counters as one time, and a body that is measured
elsewhere may be earlier or later than they are. A descent that begins with one time for all channels bends
law, gain and limits until they make up for the difference, and does not come back. So the simple robot, which
was fitted to the wheels alone, is simulated with a few such times first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

from mecanum_env.model import Model
from mecanum_env.statistics import VERY_STRONG

_SHARES: Final = (0.25, 0.5, 0.75, 1.0)
"""Shares of the delay of the wheels that may be their sensors' alone. Assumed."""
_LATER_S: Final = (0.01, 0.02, 0.04, 0.08, 0.16)
"""By how much the sensors of the body may be later than those of the wheels [s]. Assumed."""
_LINK: Final = "command_latency"


def with_sensor_times(model: Model, cost: Callable[[Model], float]) -> Model:
    """Return a model whose sensors are as late as predicts all channels of some logs best.

    The logs must show more than the wheels. `cost` is the sum of squared residuals of a model, in variances
    of the noise, infinite if it cannot be simulated. Unless it falls by `VERY_STRONG`, one time for all
    channels is enough, and the model is returned as it is.
    """
    found = min((*_earlier_body(model), *_later_body(model)), key=cost)
    return found if cost(found) < cost(model) - VERY_STRONG else model


def _earlier_body(model: Model) -> Iterator[Model]:
    """Yield the model with more and more of its delay in the sensors of the wheels."""
    whole_s = model.effects.get(_LINK, {}).get("delay_s", 0.0)
    for share in _SHARES if whole_s > 0.0 else ():
        link = model.with_effect(_LINK, delay_s=(1.0 - share) * whole_s)
        yield link.with_effect("sensor_latency/wheels", delay_s=share * whole_s)


def _later_body(model: Model) -> Iterator[Model]:
    """Yield the model with sensors of the body's speed, its pose, or both that are later."""
    body, pose = "sensor_latency/body", "sensor_latency/pose"
    for later_s in _LATER_S:
        for late in ((body,), (pose,), (body, pose)):
            found = model
            for name in late:
                found = found.with_effect(name, delay_s=later_s)
            yield found
