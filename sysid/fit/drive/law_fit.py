"""The wheel law fitted behind the commands of some logs, and the evidence for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from mecanum_env.law import WheelLaw
from mecanum_env.model import Wheel
from sysid.compare.links import AlignedLogs
from sysid.fit.drive.command_path import CommandPath
from sysid.fit.drive.fitter import fitter_of
from sysid.fit.drive.wheel_data import longest_hold_s, pooled
from sysid.fit.estimators import Estimate, WheelRun
from sysid.fit.options import FitOptions
from sysid.fit.statistics import MethodMetrics, ResidualTests, Runs, Uncertainty
from sysid.logs import Dataset, Split
from sysid.logs.tail_laws import Tails


@dataclass(frozen=True)
class LawFit:
    """A fitted law of a wheel."""

    dataset: Dataset
    path: CommandPath
    options: FitOptions
    sigma_rpm: Mapping[str, float]
    """Noise of each wheel-speed column [rpm], by which residuals are weighted."""
    sigma_from_repeats: bool
    """Whether the noise is from repeats; else it is the residual of the fit."""
    estimate: Estimate
    """By the first method, on the fit runs of all wheels."""
    uncertainty: Uncertainty
    residual_tests: ResidualTests
    methods: Mapping[str, MethodMetrics]
    wheels: Mapping[str, Estimate]
    """With `per_wheel`: wheel name -> its own estimate."""
    runs: Runs
    link: AlignedLogs | None = None
    """From bench logs: those with each change of the command where it acted, if changes act at times of their
    own. `dataset`, `path` and `runs` are then of these."""
    tails: Mapping[str, Tails] = field(default_factory=dict)
    """Channel -> its noise, where that has heavy tails and outliers were weighted down."""
    notes: tuple[str, ...] = field(default=())
    """What was inferred, assumed or could not be determined, in sentences."""

    @property
    def law(self) -> WheelLaw:
        """The fitted law."""
        return self.estimate.law

    @property
    def longest_hold_s(self) -> float:
        """The longest time [s] for which a command of the fit runs is held."""
        return longest_hold_s(self.runs)

    def pooled(self, split: Split) -> list[WheelRun]:
        """Return the runs of all wheels in a `split`."""
        return pooled(self.runs[split])

    def with_free_gain(self) -> Estimate:
        """Return the law with the same delay and any DC gain."""
        fitter = fitter_of(self.options, self.path, self.dataset)
        return fitter.run(
            self.pooled("fit"), starts=self.options.starts, delay_s=self.estimate.delay_s, unit_gain=False
        )


def wheel_model(path: CommandPath, found: Estimate) -> Wheel:
    """Return the wheel of a model: the law that was `found`, with its ceiling, behind the command `path`."""
    return Wheel(
        law=found.law,
        command_period_s=path.command_period_s,
        command_quantum_rpm=path.quantum_rpm,
        saturation_rpm=min(found.saturation_rpm, path.saturation_rpm),
    )


def latency(found: Estimate) -> dict[str, dict[str, float]]:
    """Return the effects of a model: the delay that was `found`, if there is one."""
    return {"command_latency": {"delay_s": found.delay_s}} if found.delay_s > 0.0 else {}
