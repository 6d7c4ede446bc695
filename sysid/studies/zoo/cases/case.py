"""A case of the zoo: what was hidden in which drive or robot, and how large its trace in the logs is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from sysid.logs.runs import Level

Kind = Literal["quiet", "single", "pair", "triple", "twin", "untestable", "near_outsider", "far_outsider"]
"""Nothing changed; one, two or three effects; an effect that these logs cannot tell from another; one that
they cannot show; a change that no name covers, close to a named one or far from all."""
Driven = Literal["other", "same"]
"""Which commands the logs of a case drive: others than those of its fit, or the same again."""


@dataclass(frozen=True)
class Hidden:
    """One hidden effect, in the words of the effects' contract."""

    name: str
    form: str
    parameters: Mapping[str, float] = field(default_factory=dict)
    """The truth in the contract's units, for parameters that physics gives; others are left out."""
    signal: float = 0.0
    """Rms of what this effect alone does to the logs, over the noise of repeats."""


@dataclass(frozen=True)
class Case:
    """One hidden truth, to be found from logs and a model fitted to the nominal logs."""

    seed: int
    level: Level
    kind: Kind
    family: str
    """Topology of the drive."""
    plan: str
    """Name of the command plan of the logs."""
    layout: str
    """Name of the study's layout: how many runs, repeats, which sampling."""
    hidden: tuple[Hidden, ...] = ()
    outsider: str = ""
    """For the outsiders: what was changed, in words."""
    twins: tuple[str, ...] = ()
    """Names that no log of this kind can tell from the hidden one."""
    signal: float = 0.0
    """Rms of what the change does to the logs, over the noise of repeats; worst channel of a robot."""
    driven: Driven = "other"

    @property
    def name(self) -> str:
        """Such as "bench-0042-single-backlash", or "bench-0042-same-..." with the commands of the fit."""
        what = "+".join(h.name for h in self.hidden) or self.outsider.replace(" ", "_") or "nothing"
        return f"{short_name(self.level, self.seed, self.driven)}-{self.kind}-{what}"


def short_name(level: Level, seed: int, driven: Driven) -> str:
    """Return how the name of a case of a level and a seed begins, which is known before it is drawn.

    `driven` says which commands its logs drive.
    """
    return f"{level}-{seed:04d}" + ("-same" if driven == "same" else "")
