"""What a drive does besides its law, found while the law is fitted: friction, a dead zone, limits, a gain.

The law alone is the model as long as it is enough. An effect is added, and law and effects are fitted again
together, only if three things hold: the cost falls by more than `EVIDENCE` beyond the price of its parameters
(BIC), the validation runs are predicted better by `WORTH`, and no smaller set does as well
(`sysid.fit.effects.reached`). Of such sets the cheapest is taken that no other one beats clearly on the
validation runs: what fits the fit runs only may have the best price. The noise is that of repeats; where the
model leaves more than the noise, the residual's variance is used instead.

A law of unit DC gain fits a drive that never reaches its command by a pole that never settles. Two laws are
therefore starting points: that of the fit, and one with a free gain, which becomes the effect `speed_gain`. A
pole slower than the logs can show only imitates a gain, and errs as soon as a command is held longer: if the
law of the fit has one, first-order laws with a free gain are the starts, and no pole may become that slow.
The law of the fit stays all the same if it predicts the validation runs far better than what is found.
Where the law leaves much more than the noise, a simple drive (`sysid.fit.effects.simple_drive`) and drives
under PI control (`sysid.fit.effects.pi_drive`) are starts, too.

A gap in the gear costs a quick wheel a moment at each reversal, which a delay or friction may as well, and a
slow one all of its motion. It is therefore named only if no set without it predicts the validation runs
nearly as well (`GAP_WORTH`).

A dead zone that subtracts and friction on a drive without integral action take the same speed from a wheel
that turns, and differ only while it starts and stops. Where the logs do not tell them apart, it is friction:
every motor has some. A later study of the same motor then does not take its friction for news.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.effects.friction import droop_rpm, stiffness_is_known, torques_of
from mecanum_env.law.stability import POLE_LIMIT
from mecanum_env.model import Model, cause_of
from mecanum_env.units import FloatArray
from sysid.compare.measured import observe, select_runs
from sysid.compare.model_error import Whitener
from sysid.compare.noise import measure_noise
from sysid.fit.effects.beam import searched
from sysid.fit.effects.candidates import drive_candidates, first_order_laws
from sysid.fit.effects.ceiling import HeldSpeeds
from sysid.fit.effects.pi_drive import KINDS
from sysid.fit.effects.reached import HeldOut, Reached, confirmed
from sysid.fit.effects.search import EffectSearch
from sysid.logs import Dataset
from sysid.progress import Progress, silent, within

_FAR: Final = 2.0
"""Squared error of the law over the noise from which a simple drive, fitted globally, is a start, too; and
that of what is found over that of a law that is not enough, above which the law stays. Assumed."""
GAP: Final = "backlash"
"""The cause that acts most where logs show it least."""
GAP_WORTH: Final = 0.1
"""Least relative decrease of the error on the validation runs by a gap in the gear. Calibrated on drawn
drives (python benchmarks/fit_gaps.py)."""
_SECONDS: Final = 40.0
_TICKS: Final = (4000, 8000)
"""Duration of the runs that decide, repeats not counted [s], and fewest and most ticks of the law in them:
those of a slow law may be longer, those of a fast one must be shorter, since ticks take the time."""


@dataclass(frozen=True, eq=False)
class DriveEffects:
    """Law and effects that were fitted together."""

    model: Model
    """The model with the law and the effects."""
    covariance: FloatArray
    """Of the law's coefficients, shape (6, 6)."""
    before_rpm: float
    """Rms error of the wheel speed by the law alone on the validation runs (the fit runs if there are none),
    repeats averaged [rpm]."""
    after_rpm: float
    """The same with the effects."""

    @property
    def note(self) -> str:
        """What was found, in a sentence."""
        found = "; ".join(
            f"{name} " + ", ".join(f"{key} {value:.4g}" for key, value in self._sizes(name).items())
            for name in self.model.effects
        )
        windup = self.model.wheel.windup
        integral = f"; its integral winds up at the motor's bounds (windup {windup:g})" if windup else ""
        return (
            f"the drive is not the law alone: {found}; fitted together with the law, they change "
            f"the held-out error, repeats averaged, from {self.before_rpm:.3g} to {self.after_rpm:.3g} rpm"
            + integral
        )

    def _sizes(self, name: str) -> dict[str, float]:
        """Return the parameters of an effect; a torque as the speed that it takes, in N m only if known."""
        values, torques = dict(self.model.effects[name]), torques_of(name)
        if not values.keys() & set(torques):
            return values
        told = {"droop_rpm": droop_rpm(name, values, self.model)}
        known = stiffness_is_known(self.model)
        return told | {key: value for key, value in values.items() if known or key not in torques}


def find_drive_effects(
    dataset: Dataset,
    alone: Model,
    others: Sequence[Model] = (),
    largest_pole: float = POLE_LIMIT,
    progress: Progress = silent,
) -> DriveEffects | None:
    """Return the law with the effects that bench logs show, None if the law alone is enough.

    Searches start from the law that was fitted `alone`, unless a pole of it exceeds `largest_pole`, and from
    `others`. `progress` is called before the search, and before each round of it.
    """
    progress(stage := "drive effects")
    tell = within(progress, stage)
    fewest_s, most_s = (ticks * alone.wheel.law.sample_period_s for ticks in _TICKS)
    seconds = min(max(_SECONDS, fewest_s), most_s)
    runs = select_runs(dataset.split("fit"), seconds, alone.wheel.command_period_s)
    observations = observe(replace(dataset, runs=runs))
    whitener = Whitener(observations, measure_noise(dataset, observations), None)
    held_out = HeldOut.of(dataset)
    is_enough = float(np.max(np.abs(alone.wheel.law.poles))) < largest_pole
    laws = (alone, *others) if is_enough else tuple(first_order_laws(alone, largest_pole))
    known = drive_candidates(dataset.columns, command_falls=dataset.command_falls)
    held = HeldSpeeds.of(observe(replace(dataset, runs=dataset.split("fit"))))

    def search_from(law: Model) -> EffectSearch:
        return EffectSearch(law, whitener, held_out, largest_pole, known, held=held)

    searches = [search_from(law) for law in laws]
    began = [start for search in searches if (start := search.begin()) is not None]
    if not began or (is_enough and began[0].base is not searches[0].base):
        return None
    if not is_enough:
        # The starts differ in nothing but the time constant.
        began = [min(began, key=lambda start: start.fitted.cost)]
        searches = [search for search in searches if search.base is began[0].base]
    first = began[0]
    if first.inflation > _FAR:
        tell("a simple drive, from anywhere")
        anywhere = [searches[0].simple_drive(alone)]
        tell("a drive under PI control, from anywhere")
        anywhere += [searches[0].pi_drive(alone, kind) for kind in KINDS]
        searches += [search_from(model) for model in anywhere]
        began += [start for search in searches[-len(anywhere) :] if (start := search.begin()) is not None]

    before, before_rpm = held_out.errors(alone)

    def best_of(searches: Sequence[EffectSearch]) -> Reached | None:
        """Return the best set that searches find; None where the law alone stays."""
        reached = searched(searches, began, tell)
        best = in_place_of(first, reached, held_out.whitener.size, is_enough=is_enough)
        best = best or (None if is_enough else first)
        worse = best is not None and best.held_out**2 > (1.0 if is_enough else _FAR) * before**2
        return None if worse else best

    best = best_of(searches)
    if best is not None and any(cause_of(name) == GAP for name in best.model.effects):
        tell("without a gap in the gear")
        other = best_of([search.without(GAP) for search in searches])
        if best.held_out > (1.0 - GAP_WORTH) * (before if other is None else other.held_out):
            best = other
    if best is None:
        return None
    model, of_law = best.stated()
    return DriveEffects(model, of_law, before_rpm, best.held_out_rpm)


def in_place_of(
    first: Reached, reached: Sequence[Reached], samples: int, *, is_enough: bool
) -> Reached | None:
    """Return which of the sets `reached`, best price first, takes the place of the first law, if any does.

    It is confirmed on the `samples` of the held-out runs. Where the law `is_enough` and leaves little, only
    the set with the best price may, and if held-out runs refuse that, the law stays: smaller sets may pass,
    as the supply limit of the bundled logs would. A law that is not enough has no such claim.
    """
    tried = reached[:1] if is_enough and first.inflation <= _FAR else reached
    return confirmed([one for one in tried if one is not first and one.better_than(first)], samples)
