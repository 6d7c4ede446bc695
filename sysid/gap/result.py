"""Records of a gap study: its options and its results, as written to gap.json and drawn on the page."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from mecanum_env.effects.friction import torques_of
from mecanum_env.model import CustomEffect, Model, cause_of, form_of
from mecanum_env.simulator import RobotPlant
from mecanum_env.units import FloatArray
from sysid.logs import Dataset, Finding, Split
from sysid.logs.runs import Level
from sysid.logs.tail_laws import Tails

Verdict = Literal["no_gap", "named", "ambiguous", "unexplained"]
"""No significant gap; one smallest set of effects explains it; several equally well; none does."""


Since = Literal["new", "already when fitted", "unknown"]
"""Of an effect: absent when the model was fitted; in the logs of its fit, too; nothing tells."""


@dataclass(frozen=True)
class Spent:
    """What a study spent of the false alarms that all studies of the same logs may raise."""

    data_sha256: str
    """Checksum of the logs."""
    study: str
    """Checksum of logs, model and settings: the same study again spends nothing."""
    level: float
    """Probability of a false alarm."""


@dataclass(frozen=True)
class GapOptions:
    """What a user may decide about a study."""

    seed: int = 0
    """Seed of the simulated thresholds, the bootstrap and the design of experiments."""
    level: Literal["auto", "bench", "robot"] = "auto"
    """Level that the logs must have; auto accepts both."""
    only: tuple[str, ...] = ()
    """Effects to consider; empty: all that act on this level."""
    exclude: tuple[str, ...] = ()
    """Effects not to consider."""
    max_effects: int = 3
    """Size of the largest set of effects that is tried."""
    jobs: int = 1
    """Simulations at a time; results do not depend on it."""
    plant: RobotPlant = "rollers"
    """How a robot is simulated; the planar plant does not slip and is much faster."""
    seconds: float | None = None
    """Duration of the runs that decide, repeats not counted [s]; None: 240 on the bench, 60 on the robot."""
    adopt: bool = False
    """Whether to add the proposed custom effect to the model if no named effect explains the gap."""
    next_experiment: bool = True
    """Whether to design the next experiment."""
    fitted_on: Dataset | None = None
    """The logs that the model was fitted to: what they show, too, is no new effect."""
    fitted_here: Model | None = None
    """The studied law with effects, both fitted to these very logs: its effects are a set that is tried,
    however many they are, and where each command acted at a time of its own, it tells the times. None: no
    such fit."""
    earlier: tuple[Spent, ...] = ()
    """Earlier studies; those of the same logs lower the probability of a false alarm in this one."""
    notes: tuple[str, ...] = ()
    """What is known of these options, in sentences, for the notes of the report."""


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
    """Its name in the catalogue: the cause, and behind a slash its form if that is not the first."""
    parameters: Mapping[str, Interval]
    """Parameter, by its name in the model file -> estimate."""
    selection_frequency: float
    """Share of bootstrap resamples of the command sequences in whose best set the effect is."""

    droop_rpm: Interval | None = None
    """Of an effect that is a torque: the speed that it takes from a drive without integral action [rpm]; of
    viscous friction at the top speed of the logs."""
    torque_known: bool = True
    """Whether the model's servo stiffness is known, so that torques mean something in N m."""
    forms_tied: tuple[str, ...] = ()
    """Other forms of the same cause that explain these logs as well."""
    since: Since = "unknown"
    """Whether it is new since the model was fitted."""

    @property
    def estimates(self) -> dict[str, Interval]:
        """What a reader is told: the parameters, and a torque as a droop, in N m only if that is known."""
        if self.droop_rpm is None:
            return dict(self.parameters)
        torques = torques_of(self.name)
        told = {n: i for n, i in self.parameters.items() if self.torque_known or n not in torques}
        return {"droop_rpm": self.droop_rpm, **told}

    @property
    def cause(self) -> str:
        """The physical cause, which the verdict names."""
        return cause_of(self.name)

    @property
    def form(self) -> str:
        """The form that the cause takes; "" if it has one only."""
        return form_of(self.name)

    @property
    def intervals(self) -> dict[str, dict[str, float]]:
        """What a model file keeps of each parameter: value, low and high, if all are finite."""
        kept = {name: {"value": i.value, "low": i.low, "high": i.high} for name, i in self.parameters.items()}
        return {name: ends for name, ends in kept.items() if all(map(math.isfinite, ends.values()))}


@dataclass(frozen=True)
class Difference:
    """Root mean square of measured minus simulated, in one channel or over all."""

    unit: str
    """Unit of the channel; "sigma" over several channels: standard deviations of each channel's noise."""
    before: float
    """Rms error of the model as given."""
    after: float
    """Rms error of the improved model."""
    noise_floor: float | None
    """Standard deviation of the noise, from all repeats in the logs, test runs included, or else from
    those in the logs of the fit; None without any."""
    motion: float | None = None
    """Rms of the measured channel, which says how large an error is; of a pose, from where the run starts."""


@dataclass(frozen=True)
class Region:
    """The error of one channel in one part of the motion."""

    channel: str
    dimension: str
    """What divides the samples: phase, speed, direction, time, heading, battery, repeat or wheel."""
    region: str
    """Part of the dimension, such as "reversal" or "80 .. 130 rpm"."""
    rms: float
    """Rms error before, in the channel's unit."""
    rms_after: float
    """Rms error after, in the channel's unit."""
    share: float
    """Share of the channel's squared error before, over all regions of the dimension."""
    samples: int
    """Number of samples in the region."""


@dataclass(frozen=True)
class Untestable:
    """An effect that these logs could not show."""

    name: str
    reason: str
    smallest_detectable: Mapping[str, float]
    """Parameter -> size that would be seen with a probability of 90 %; empty if none would."""


@dataclass(frozen=True)
class Evidence:
    """One set of effects, fitted and judged."""

    effects: tuple[str, ...]
    """Names of the effects; empty: the model as it is; ("wheel_law",): its law fitted again."""
    parameters: Mapping[str, Mapping[str, float]]
    """Effect -> parameter -> value."""
    parameter_count: int
    score: float
    """-2 log predictive density of each command sequence given the others, relative to the model as it is;
    lower is better."""
    misfit: float
    """Squared error relative to its expectation under noise, parameter and model error; 1 is ideal."""
    adequate: bool
    """Whether chance allows this misfit."""
    validation_rms: float
    """Rms error on the validation runs, in the unit of the study's gap."""
    test_rms: float
    """Rms error on the test runs, in the unit of the study's gap."""
    bic: float
    """Bayesian information criterion."""


@dataclass(frozen=True)
class Overlay:
    """One channel of one run as measured and as simulated before and after; arrays have shape (n,)."""

    file: str
    split: Split
    channel: str
    unit: str
    time_s: FloatArray
    measured: FloatArray
    before: FloatArray
    after: FloatArray
    command: FloatArray | None
    """Command at the same times, if it has the channel's unit."""


@dataclass(frozen=True)
class Experiment:
    """A command sequence that separates tied candidates, or shows effects that the logs could not."""

    why: str
    candidates: tuple[tuple[str, ...], ...]
    """Sets of effects that it separates; empty if it shows effects that the logs could not."""
    time_s: FloatArray
    """Times of the commands [s], shape (k,)."""
    columns: Mapping[str, FloatArray]
    """Command column of a log -> values, shape (k,)."""
    duration_s: float
    power: float
    """Probability that three repeats of it leave the true candidate alone, whichever it is, apart from those
    that no command separates from it, as `why` says; or that they show each effect that `why` names."""
    predicted: Mapping[str, Mapping[str, FloatArray]] = field(default_factory=dict)
    """Candidate (names joined by " + ") -> channel -> prediction at `predicted_time_s`, to draw."""
    predicted_time_s: FloatArray | None = None


@dataclass(frozen=True)
class CustomProposal:
    """A custom effect for a gap that no named effect explains: a description, not a cause."""

    effect: CustomEffect
    """As the model file has it."""
    explained: float
    """Share of the squared difference that it explains in command sequences left out of its choice."""
    stations_tied: tuple[str, ...]
    """Other stations at which some formula explains these logs as well."""
    after: float
    """Rms error with it, in the unit and on the runs of the study's gap."""
    adopted: bool
    """Whether it was added to the improved model (`--adopt`)."""


@dataclass(frozen=True)
class GapReport:
    """All results of a study."""

    verdict: Verdict
    effects: tuple[FoundEffect, ...]
    """Effects that were added to `model`; empty for no_gap and unexplained."""
    candidates: tuple[tuple[str, ...], ...]
    """Every smallest set that explains the data equally well, the adopted one first."""
    gap: Difference
    """Difference over all channels, on the runs that `held_out` and `unseen` describe."""
    channels: Mapping[str, Difference]
    """Channel -> difference on the same runs."""
    where: tuple[Region, ...]
    """Regions of the error on the same runs, largest share first."""
    untestable: tuple[Untestable, ...]
    smallest_detectable: Mapping[str, Mapping[str, float]]
    """Effect -> parameter -> size, for every effect considered that these logs could show."""
    next_experiment: Experiment | None
    evidence: tuple[Evidence, ...]
    """Sets of effects, best score first."""
    p_value: float
    """Probability of a difference at least this large if the model were right."""
    model: Model
    """The model with the effects added."""
    base: Model
    """The model as given."""
    level: Level
    dataset: str
    """Name of the logs."""
    findings: tuple[Finding, ...]
    """What the check of the logs noticed."""
    notes: tuple[str, ...]
    """What was assumed, inferred or could not be told, in sentences."""
    overlays: tuple[Overlay, ...]
    """The runs of largest error before."""
    custom: CustomProposal | None
    """Proposed where the verdict is "unexplained" and a formula or a table describes the difference."""
    provenance: Mapping[str, Any]
    """Seed, checksums of data and model, and version."""
    held_out: Split = "test"
    """Split of the runs in `gap`, `channels`, `where` and `overlays`: "test", or what stood in for it."""
    unseen: bool = True
    """Whether those runs took no part in the decision."""
    trusted: bool = True
    """Whether it is known what a right model would leave; if not, a difference may be noise or not."""
    tails: Mapping[str, Tails] = field(default_factory=dict)
    """Channel -> its noise, where that has heavy tails and outliers were weighted down."""
    false_alarm: float = 0.01
    """Probability of a false alarm that this study spent, after what earlier ones of these logs left."""
    studies: tuple[Spent, ...] = ()
    """All studies of these logs that are known, this one included."""
    gap_beside_fit: Difference | None = None
    """The gap on the same runs without what the model errs by in the logs of its fit; None without these, or
    if they hold other commands."""

    @property
    def new_effects(self) -> tuple[FoundEffect, ...]:
        """Effects that explain what changed: without those that were there already when the model was fitted.

        All of them, if each was there already.
        """
        new = tuple(effect for effect in self.effects if effect.since != "already when fitted")
        return new or self.effects

    @property
    def changed(self) -> bool:
        """Whether the improved model differs from the one that was given."""
        return bool(self.effects) or (self.custom is not None and self.custom.adopted)
