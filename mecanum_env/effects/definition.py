"""What an effect is: its parameters, what it looks like in data, and what it changes in the simulation.

One `Effect` says everything about it; simulator, file format, documentation and whoever searches for effects
read it from there. Its `change_...` functions are where it acts; an effect has one or several, and one
without any is named in the catalogue but refused by the simulator.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Literal

from mecanum_env.units import FloatArray

if TYPE_CHECKING:
    import mujoco

    from mecanum_env.law.drive import DriveParameters
    from mecanum_env.model import Model

PlantKind = Literal["bench", "rollers", "planar"]
"""One free wheel; the robot on its rollers; the robot that slides without slip."""
RobotPlant = Literal["rollers", "planar"]
"""The plants that are the whole robot."""
PLANTS: Final[tuple[PlantKind, ...]] = ("bench", "rollers", "planar")

SPEED_UNITS: Final = ("rpm", "rpm/s")
"""Of parameters whose sizes go with how fast a robot is."""
Values = Mapping[str, float]
"""Parameter name -> value."""
Channels = Mapping[str, FloatArray]
"""Column of a log -> its samples on the physics clock, shape (n,)."""


@dataclass(frozen=True)
class Parameter:
    """One number of an effect."""

    name: str
    """With its unit, as in the model file."""
    unit: str
    neutral: float | str | None
    """The value at which it changes nothing; a string names the model's own value ("robot.friction"); None
    for one that matters only beside another (the height of a payload)."""
    bounds: tuple[float, float]
    """Where a search looks, on a robot about as fast as the packaged one; see `scaled`."""
    valid: tuple[float, float] = (0.0, math.inf)
    """What the simulator takes, ends included; infinity itself only where that is neutral."""
    default: float = 0.0
    """The value where the model file leaves it out, if `neutral` is None."""
    scan: tuple[float, ...] | None = None
    """Values to try one by one, where the response has no useful gradient (thresholds)."""

    stepwise: bool = False
    """The response jumps where it passes a command, and is flat in between."""
    simulated: bool = True
    """False: named in the contract, but refused unless neutral."""

    def neutral_in(self, model: Model) -> float:
        """Return the value that a model without it has: neutral, the model's own, or the default."""
        if self.neutral is None:
            return self.default
        if isinstance(self.neutral, str):
            section, field = self.neutral.split(".")
            return float(getattr(getattr(model, section), field))
        return self.neutral

    def scaled(self, factor: float) -> Parameter:
        """Return the parameter with bounds and scan for a robot `factor` times as fast as the packaged one.

        What is no speed or acceleration stays as it is; and so does what the simulator takes.
        """
        if factor == 1.0 or self.unit not in SPEED_UNITS:
            return self
        low, high = self.bounds
        scan = None if self.scan is None else tuple(factor * value for value in self.scan)
        return replace(self, bounds=(max(self.valid[0], factor * low), factor * high), scan=scan)


ChangeModel = Callable[["Model", Values], "Model"]
"""Return the model with other numbers in its sections."""
ChangeSpec = Callable[["mujoco.MjSpec", Values, "Model", PlantKind], None]
"""Write into the generated MuJoCo model; the `Model` is the one that it was generated from."""
ChangeDrive = Callable[["DriveParameters", Values, str | None], "DriveParameters"]
"""Return a wheel's drive with other numbers; the wheel is fl .. rr, or None for the common one."""
LimitBody = Callable[[FloatArray, FloatArray, Values, float], tuple[FloatArray, FloatArray]]
"""Return the body command (forward, left, turn) [rpm] that follows the previous one after some time [s], and
its mean over that time."""
ChangeChannels = Callable[[FloatArray, Channels, Values], dict[str, FloatArray]]
"""Return channels as measured, given the uniform clock [s] they lie on and what they truly are."""


@dataclass(frozen=True)
class Effect:
    """A named departure from the ideal robot."""

    name: str
    acts_on: str
    parameters: tuple[Parameter, ...]
    summary: str
    """What it is, one line."""
    signature: str
    """What it looks like in data, one line."""
    absent_from: tuple[PlantKind, ...] = ()
    """Plants without the part it acts on: there it changes nothing, rightly (a payload on the bench)."""
    refused_by: tuple[PlantKind, ...] = ()
    """Plants that have the part but cannot express the effect: they refuse the model."""
    change_model: ChangeModel | None = None
    change_spec: ChangeSpec | None = None
    change_drive: ChangeDrive | None = None
    limit_body: LimitBody | None = None
    change_channels: ChangeChannels | None = None

    @property
    def simulated(self) -> bool:
        """Whether any plant simulates it."""
        hooks = (self.change_model, self.change_spec, self.change_drive, self.limit_body)
        return any(hook is not None for hook in (*hooks, self.change_channels))

    @property
    def measured_only(self) -> bool:
        """Whether it acts on the measurement and leaves the motion alone."""
        hooks = (self.change_model, self.change_spec, self.change_drive, self.limit_body)
        return self.change_channels is not None and all(hook is None for hook in hooks)

    def acts_in(self, plant: PlantKind) -> bool:
        """Return whether it changes something on the plant."""
        return self.simulated and plant not in (*self.absent_from, *self.refused_by)

    def complete(self, values: Values, model: Model) -> dict[str, float]:
        """Return all parameters, those that the model file leaves out at neutral or default.

        Args:
            values: as the model file has them.
            model: whose own values may be neutral.
        """
        return {p.name: values.get(p.name, p.neutral_in(model)) for p in self.parameters}

    def is_neutral(self, values: Values, model: Model) -> bool:
        """Return whether the values change nothing in a model."""
        full = self.complete(values, model)
        return all(full[p.name] == p.neutral_in(model) for p in self.parameters if p.neutral is not None)
