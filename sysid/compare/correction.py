"""A readable correction of predicted channels, found by regression."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.features import Feature, features
from sysid.compare.samples import HeldCommand
from sysid.logs import Run
from sysid.logs.runs import UNITS

KEY: Final = "empirical"
"""Of the model file's own field that holds an adopted correction."""
LABEL: Final = "added to the predicted channel; found by regression on what was left over, not physics"


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
