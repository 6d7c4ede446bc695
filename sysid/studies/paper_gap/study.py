"""The whole study of the paper's gap, and its record as JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from mecanum_env.model import Model, paper_model
from mecanum_env.units import FloatArray
from sysid.progress import Progress, silent
from sysid.studies.paper_gap.drives import HOLD_S, NUMBERS, PAPER, TOLERANCE, TURN_RPM, drive_metrics
from sysid.studies.paper_gap.search import (
    TURN_SPEEDS_RPM,
    Reach,
    Suspect,
    Turn,
    grown_sets,
    movers,
    needless,
    reaches,
    suspects,
    suspects_turning,
    with_integral,
)
from sysid.studies.paper_gap.sets import Fitter, SetFit

STAGES: Final = 5
MOST_EFFECTS: Final = 4
"""Largest number of effects in a set; with more there are more parameters than numbers."""
_NEAREST: Final = 5
"""Number of sets of each size in the table, besides those that reproduce all numbers."""


@dataclass(frozen=True, eq=False)
class PaperGap:
    """What was found."""

    reach: tuple[Reach, ...]
    """Every effect alone."""
    sets: tuple[SetFit, ...]
    """The best sets of each size and all that reproduce the six numbers; fewest parameters first."""
    worsts: FloatArray
    """The largest deviation of every set that was fitted, needless ones left out."""
    on_rollers: tuple[FloatArray, ...]
    """The six numbers on rollers of each set that reproduces them, in the order of `reproducing`."""
    suspects: tuple[Suspect, ...]
    turn: Turn
    integral: SetFit
    """The best of the sets on a drive with integral action."""
    base: FloatArray
    """The six numbers of the unchanged model, on rollers."""

    @property
    def reproducing(self) -> tuple[SetFit, ...]:
        """The sets that reproduce all six numbers within the tolerance, fewest parameters first."""
        return tuple(found for found in self.sets if found.worst <= 1.0)


def paper_gap(progress: Progress = silent) -> PaperGap:
    """Search for sets of effects that reproduce the six numbers.

    `progress` is called with a message before each long step.
    """
    base = paper_model()
    progress("what each effect can do")
    reach = reaches(base)
    names = movers(reach)
    progress("the paper's suspects")
    suspected = suspects(base)
    turn = suspects_turning(base)
    progress("sets of effects")
    fitter = Fitter(base)
    fitted = grown_sets(fitter, names, MOST_EFFECTS)
    kept = [f for f in fitted.values() if not needless(f, fitted.values())]
    sets = _shown(kept)
    progress("a drive with integral action")
    first = min(kept, key=lambda f: f.misfit)
    integral = Fitter(with_integral(base)).built(first.names)
    progress("on rollers")
    good = [f for f in sets if f.worst <= 1.0]
    rollers = [_on_rollers(fitter.model(f.chosen, f.place)) for f in good]
    return PaperGap(
        reach=tuple(reach),
        sets=sets,
        worsts=np.array([f.worst for f in kept]),
        on_rollers=tuple(rollers),
        suspects=tuple(suspected),
        turn=turn,
        integral=integral,
        base=_on_rollers(base),
    )


def _on_rollers(model: Model) -> FloatArray:
    return drive_metrics(model, "rollers").six


def _shown(fitted: list[SetFit]) -> tuple[SetFit, ...]:
    """Return the sets that reproduce all six numbers and the nearest of each size."""
    ordered = sorted(fitted, key=lambda f: (f.chosen.parameter_count, f.misfit, f.names))
    nearest = {
        f.names
        for size in range(1, MOST_EFFECTS + 1)
        for f in sorted((f for f in fitted if len(f.names) == size), key=lambda f: f.misfit)[:_NEAREST]
    }
    return tuple(f for f in ordered if f.worst <= 1.0 or f.names in nearest)


def paper_gap_json(found: PaperGap) -> dict[str, Any]:
    """Return the study for a JSON file."""
    return {
        "figures": list(NUMBERS),
        "paper": PAPER.tolist(),
        "tolerance": TOLERANCE.tolist(),
        "hold_s": HOLD_S,
        "turn_rpm": TURN_RPM,
        "model_as_it_is": found.base.tolist(),
        "reach": {r.name: {"least": r.least.tolist(), "most": r.most.tolist()} for r in found.reach},
        "sets_tried": found.worsts.size,
        "sets": [_set_json(f) for f in found.sets],
        "on_rollers": {
            " + ".join(f.names): six.tolist()
            for f, six in zip(found.reproducing, found.on_rollers, strict=True)
        },
        "suspects": [{"title": s.title, **_set_json(s.fit)} for s in found.suspects],
        "suspects_without_turn": {
            **_set_json(found.turn.fit),
            "turn_speeds_rpm": TURN_SPEEDS_RPM.tolist(),
            "turn_losses": found.turn.losses.tolist(),
        },
        "with_integral_action": _set_json(found.integral),
    }


def _set_json(found: SetFit) -> dict[str, Any]:
    return {
        "effects": found.values,
        "parameters": found.chosen.parameter_count,
        "predicted": np.nan_to_num(found.six).tolist(),
        "misfit": found.misfit,
        "worst": found.worst,
    }
