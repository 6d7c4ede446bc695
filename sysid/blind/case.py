"""What a blind test is, and what the makers of blind tests must offer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol

Kind = Literal["single", "pair", "none", "outside", "twin", "untestable"]
Size = Literal["clear", "small", "-"]
Level = Literal["bench", "robot"]


@dataclass(frozen=True)
class Case:
    """One hidden truth, to be found from logs and a nominal model alone."""

    name: str
    level: Level
    kind: Kind
    size: Size
    plant: str
    """Whose effect-free logs give the model."""
    hidden: tuple[str, ...]
    """Effects of the catalogue that are there; for `outside` what it is, in our own words."""
    truth: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Effect -> parameter -> true value, where the catalogue has a counterpart."""
    twins: tuple[str, ...] = ()
    """Effects that these logs cannot tell from the hidden one."""


class BlindTests(Protocol):
    """The makers of the logs, in `tests/blind`, which share no code with what is tested."""

    def cases(self, seed: int) -> tuple[Case, ...]:
        """Return every case that a seed gives."""
        ...

    def write_nominal(self, plant: str, folder: Path) -> None:
        """Write effect-free logs of a plant to `folder`/logs, what is known of it to `folder`/robot.json."""
        ...

    def write_case(self, name: str, seed: int, folder: Path) -> None:
        """Write the logs of a case to `folder`."""
        ...
