"""What a user may choose for a fit."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from mecanum_env.model import Robot
from sysid.fit.estimators import DEFAULT_METHOD


@dataclass(frozen=True)
class FitOptions:
    """Options of a fit."""

    methods: tuple[str, ...] = (DEFAULT_METHOD,)
    """Methods to run; the model is from the first."""
    starts: int = 10
    """Starting points of each method."""
    seed: int = 0
    """Seed of the random starting points."""
    unit_gain: bool = True
    """Whether the DC gain is held at exactly 1."""
    delay_s: float | None = None
    """Transport delay [s]; None: estimated, and adopted on evidence."""
    effects: Literal["auto", "off"] = "auto"
    """Whether bench logs may show that the drive does more than its law; see `drive_effects`."""
    per_wheel: bool = False
    """Whether a law is fitted to each wheel of a robot, too."""
    sample_period_s: float | None = None
    """Tick of the law [s]; None, here and below: inferred from the logs (`sysid.fit.drive.command_path`)."""
    command_period_s: float | None = None
    """Shortest time between commands [s]."""
    quantum_rpm: float | None = None
    """Rounding of wheel commands [rpm]."""
    saturation_rpm: float | None = None
    """Ceiling of wheel commands [rpm]."""
    robot: Robot = field(default_factory=Robot)
    """What is known of the robot, with the packaged values for the rest."""
    robot_given: tuple[str, ...] = ()
    """Names of the robot's parameters that were measured and are not fitted."""
