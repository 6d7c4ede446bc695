"""A sparse readable correction for an error that no effect explains: a clue, not physics.

Terms are chosen one after the other, each the one that lowers the squared error most with all chosen so far
refitted (orthogonal least squares; Chen, Billings and Luo, Int. J. Control 50(5), 1989). How many is decided
by leaving out one command sequence after the other; what predicts no better than nothing is not reported.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.gap.empirical_features import Feature, features
from sysid.gap.records import EmpiricalTerm
from sysid.gap.samples import HeldCommand, Samples
from sysid.gap.sparse import Sums, choose
from sysid.logs import Run
from sysid.logs.columns import UNITS

KEY: Final = "empirical"
"""Of the model file's own field that holds an adopted correction."""
LABEL: Final = "added to the predicted channel; found by regression on what was left over, not physics"
_NOT_TRIED: Final = ("x_m", "y_m", "yaw_rad", "battery_v")
"""The error of a pose is the sum of all that went wrong before; no function of the moment."""


@dataclass(frozen=True)
class Term:
    """One feature with its coefficient, or a pair with those of sine and cosine."""

    feature: str
    coefficients: tuple[float, ...]


@dataclass(frozen=True)
class Correction:
    """What is added to predicted channels."""

    terms: Mapping[str, tuple[Term, ...]]
    """By channel."""
    explained: Mapping[str, float]
    """Channel -> share of the squared error on command sequences that were left out."""

    def added(
        self, channel: str, time_s: FloatArray, wheels: HeldCommand, predicted: FloatArray
    ) -> FloatArray:
        """Return a predicted channel with the correction, shape (n,).

        Args:
            channel: column of the log; one without terms comes back as it is.
            time_s: of the samples from the start of the run [s], shape (n,).
            wheels: commands of the wheels.
            predicted: by the model without the correction, shape (n,).

        Raises:
            InputError: a term that this version does not know.
        """
        terms = self.terms.get(channel, ())
        if not terms or time_s.size < 2:
            return predicted
        known = features(channel, time_s, wheels, predicted)
        total = np.array(predicted, float)
        for term in terms:
            if term.feature not in known or len(term.coefficients) != known[term.feature].columns.shape[1]:
                raise InputError(
                    f"{KEY}: {channel} has no term {term.feature!r}{did_you_mean(term.feature, known)}"
                )
            total += known[term.feature].columns @ np.array(term.coefficients)
        return total

    def added_to(self, run: Run, predicted: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Return all predicted channels of a run with the correction.

        Args:
            run: whose commands count.
            predicted: channel -> values at the run's rows, shape (n,).
        """
        wheels = HeldCommand(*run.command_changes())
        return {name: self.added(name, run.time_s, wheels, values) for name, values in predicted.items()}

    def as_json(self) -> dict[str, Any]:
        """Return what a model file keeps under `KEY`."""
        return {
            "what": LABEL,
            "channels": {
                channel: [{"feature": t.feature, "coefficients": list(t.coefficients)} for t in terms]
                for channel, terms in self.terms.items()
            },
            "explained": dict(self.explained),
        }


def fit_correction(samples: Sequence[Samples]) -> Correction | None:
    """Return the correction of what the better model leaves over; None where nothing holds on other runs.

    Args:
        samples: of the runs that may decide; `after` is what is corrected. There must be two command
            sequences at least, since one that was not fitted has to confirm.
    """
    by_channel: dict[str, list[Samples]] = {}
    for part in samples:
        if part.channel not in _NOT_TRIED and part.time_s.size >= 2:
            by_channel.setdefault(part.channel, []).append(part)
    terms, explained = {}, {}
    for channel, parts in by_channel.items():
        tables = [features(channel, part.time_s, part.wheels, part.after) for part in parts]
        names = list(tables[0])
        widths = [tables[0][name].columns.shape[1] for name in names]
        chosen = choose(_sums(parts, tables), widths)
        if chosen is not None:
            terms[channel] = tuple(
                Term(names[group], tuple(values)) for group, values in chosen.coefficients.items()
            )
            explained[channel] = chosen.explained
    return Correction(terms, explained) if terms else None


def empirical_term(correction: Correction, adopted: bool) -> EmpiricalTerm:
    """Return a correction as the report tells it.

    Args:
        correction: as fitted.
        adopted: whether it is in the improved model's file.
    """
    return EmpiricalTerm(
        {channel: formula(channel, terms) for channel, terms in correction.terms.items()},
        correction.explained,
        adopted,
    )


def correction_of(model: Model) -> Correction | None:
    """Return the correction that a model file holds, if any.

    Raises:
        InputError: the file's field is not what `Correction.as_json` gives.
    """
    stored = model.extra.get(KEY)
    if stored is None:
        return None
    try:
        terms = {
            str(channel): tuple(Term(str(t["feature"]), tuple(map(float, t["coefficients"]))) for t in parts)
            for channel, parts in stored["channels"].items()
        }
        explained = {str(channel): float(share) for channel, share in stored.get("explained", {}).items()}
    except (TypeError, KeyError, ValueError, AttributeError) as error:
        raise InputError(
            f"{KEY}: must hold channels, each a list of feature and coefficients, as python -m sysid.gap "
            "--empirical writes them"
        ) from error
    return Correction(terms, explained)


def formula(channel: str, terms: Sequence[Term]) -> str:
    """Return a sum of terms with units, such as "-0.03 x command + 3.9 rpm x sin(wheel angle + 12 deg)".

    Args:
        channel: whose unit the sum has.
        terms: at least one.
    """
    still = HeldCommand(np.zeros(1), np.zeros((1, 4 if channel != "speed_rpm" else 1)))
    known = features(channel, np.array([0.0, 1.0]), still, np.zeros(2))
    text = " + ".join(_term_text(UNITS[channel], known[term.feature], term) for term in terms)
    return text.replace("+ -", "- ")


def _term_text(unit: str, feature: Feature, term: Term) -> str:
    per = unit if not feature.unit else "" if feature.unit == unit else f"{unit} per {feature.unit}"
    if len(term.coefficients) == 1:
        value = f"{term.coefficients[0]:.3g}{' ' + per if per else ''}"
        return value if feature.name == "1" else f"{value} x {feature.name}"
    sine, cosine = term.coefficients
    factor, _, angle = feature.name.rpartition(", ")
    phase = math.degrees(math.atan2(cosine, sine))
    value = f"{math.hypot(sine, cosine):.3g}{' ' + per if per else ''}"
    wave = f"sin({angle} {'-' if phase < 0 else '+'} {abs(phase):.0f} deg)"
    return " x ".join(filter(None, (value, factor, wave)))


def _sums(parts: Sequence[Samples], tables: Sequence[Mapping[str, Feature]]) -> list[Sums]:
    """Return the sums of products of each command sequence; of each run where there is but one sequence."""
    alone = len({part.group for part in parts}) < 2
    found: dict[str, Sums] = {}
    for part, table in zip(parts, tables, strict=True):
        error = part.errors()[1]
        known = np.isfinite(error)
        columns = np.concatenate([feature.columns for feature in table.values()], axis=1)[known]
        weight = np.ones(error.size) if part.weight is None else part.weight
        sums = Sums.of(columns, error[known], weight[known])
        key = part.run if alone else part.group
        found[key] = found[key] + sums if key in found else sums
    return list(found.values())
