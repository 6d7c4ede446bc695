"""What a gap study finds: plain records, written to gap.json and drawn on the page."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.logs import Finding, Split

Verdict = Literal["no_gap", "named", "ambiguous", "unexplained"]
"""Nothing significant; one smallest set of effects; several that explain equally well; none that does."""


@dataclass(frozen=True)
class GapOptions:
    """What a user may decide about a study."""

    seed: int = 0
    """Of the simulated thresholds and the bootstrap."""
    level: Literal["auto", "bench", "robot"] = "auto"
    """What the logs must be; auto takes what they are."""
    only: tuple[str, ...] = ()
    """Effects to consider; empty: all that act on this level."""
    exclude: tuple[str, ...] = ()
    """Effects not to consider."""
    max_effects: int = 3
    """Largest set that is tried."""
    jobs: int = 1
    """Simulations at a time; changes the time taken, not the result."""
    plant: Literal["rollers", "planar"] = "rollers"
    """That a robot is simulated with; the planar one does not slip and is much faster."""
    seconds: float | None = None
    """Of distinct commands that decide [s]; None: 240 on the bench, 60 on the robot."""
    empirical: bool = False
    """Where nothing explains the gap, add a correction by regression, which is not physics."""
    next_experiment: bool = True
    """Design the experiment that would tell tied candidates apart."""


@dataclass(frozen=True)
class Interval:
    """An estimate with its 90 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class FoundEffect:
    """An effect that was added to the model."""

    name: str
    parameters: Mapping[str, Interval]
    """By the names of the model file."""
    selection_frequency: float
    """Share of bootstrap resamples of the runs in which the set that was chosen has this effect."""

    @property
    def intervals(self) -> dict[str, dict[str, float]]:
        """What a model file keeps of the parameters: value, low, high; not of one that may be infinite."""
        kept = {name: {"value": i.value, "low": i.low, "high": i.high} for name, i in self.parameters.items()}
        return {name: ends for name, ends in kept.items() if all(map(math.isfinite, ends.values()))}


@dataclass(frozen=True)
class Difference:
    """Root mean square of measured minus simulated."""

    unit: str
    """Of the channel; "sigma": over the noise of each channel."""
    before: float
    after: float
    noise_floor: float | None
    """What repeats say the noise is; None where there are none."""


@dataclass(frozen=True)
class Region:
    """Part of the error: one channel in one region of the motion."""

    channel: str
    dimension: str
    """What divides the samples: phase, speed, direction, time, heading, battery, repeat."""
    region: str
    """Which part: "reversal", "80 .. 130 rpm" ..."""
    rms: float
    """Before, in the channel's unit."""
    rms_after: float
    share: float
    """Of the channel's squared error before, over all regions of the dimension."""
    samples: int


@dataclass(frozen=True)
class Untestable:
    """An effect that these logs could not show."""

    name: str
    reason: str
    smallest_detectable: Mapping[str, float]
    """Parameter -> size that would be seen with a probability of 90 %; empty where none would."""


@dataclass(frozen=True)
class Evidence:
    """One set of effects, fitted and judged."""

    effects: tuple[str, ...]
    """Empty: the model as it is; ("wheel_law",): its law fitted again."""
    parameters: Mapping[str, Mapping[str, float]]
    """Effect -> parameter -> value."""
    parameter_count: int
    score: float
    """-2 log predictive density of each run from the others, less that of the model as it is; lower is
    better."""
    misfit: float
    """Squared error over its expectation under noise, parameter and model error; 1 is as good as can be."""
    adequate: bool
    """Whether `misfit` is what chance allows."""
    validation_rms: float
    """In the unit of the study's gap."""
    test_rms: float
    bic: float


@dataclass(frozen=True)
class Overlay:
    """One run as measured and as simulated before and after, for the page."""

    file: str
    split: Split
    channel: str
    unit: str
    time_s: FloatArray
    measured: FloatArray
    before: FloatArray
    after: FloatArray
    command: FloatArray | None
    """On the same samples where the command has the channel's unit."""


@dataclass(frozen=True)
class Experiment:
    """A command sequence that tells tied candidates apart best, or shows what these logs could not."""

    why: str
    candidates: tuple[tuple[str, ...], ...]
    """What it separates; empty where it is to show effects that the logs could not."""
    time_s: FloatArray
    """Times of the commands [s]."""
    columns: Mapping[str, FloatArray]
    """Command columns of a log -> values, one a command."""
    duration_s: float
    power: float
    """Probability that three repeats of it name the truth, whichever candidate it is, or at least leave it
    alone with those that, as `why` says, no command separates from it."""
    predicted: Mapping[str, Mapping[str, FloatArray]] = field(default_factory=dict)
    """Candidate (joined by " + ") -> channel -> prediction at `predicted_time_s`, to draw."""
    predicted_time_s: FloatArray | None = None


@dataclass(frozen=True)
class EmpiricalTerm:
    """A readable correction found by regression on the residual: a clue, not physics."""

    formula: Mapping[str, str]
    """Channel -> the sum of terms, with units."""
    explained: Mapping[str, float]
    """Channel -> share of the squared residual on held-out runs that it explains."""
    adopted: bool
    """Whether it is part of the improved model's file (`--empirical`)."""


@dataclass(frozen=True)
class GapReport:
    """Everything that a study says."""

    verdict: Verdict
    effects: tuple[FoundEffect, ...]
    """Added to `model`; empty for no_gap and unexplained."""
    candidates: tuple[tuple[str, ...], ...]
    """Every smallest set that explains the data equally well, the adopted one first."""
    gap: Difference
    """On the runs that `held_out` and `unseen` tell of."""
    channels: Mapping[str, Difference]
    where: tuple[Region, ...]
    """Largest shares first."""
    untestable: tuple[Untestable, ...]
    smallest_detectable: Mapping[str, Mapping[str, float]]
    """Effect -> parameter -> size, for every effect considered that these logs could show."""
    next_experiment: Experiment | None
    evidence: tuple[Evidence, ...]
    """Best score first."""
    p_value: float
    """Of the largest difference between measurement and model, were the model right."""
    model: Model
    """With the effects added."""
    base: Model
    """As given."""
    level: Literal["bench", "robot"]
    dataset: str
    """Its name."""
    findings: tuple[Finding, ...]
    """What the data check noticed."""
    notes: tuple[str, ...]
    """What was assumed, inferred or could not be told, in sentences."""
    overlays: tuple[Overlay, ...]
    """The runs that were worst before."""
    empirical: EmpiricalTerm | None
    provenance: Mapping[str, Any]
    held_out: Split = "test"
    """Split of the runs compared in `gap`, `channels`, `where`, `overlays`: "test", or what stood in for it."""
    unseen: bool = True
    """Whether those runs took no part in the decision."""
    trusted: bool = True
    """Whether what a right model would leave is known: else a difference may be noise or not."""
