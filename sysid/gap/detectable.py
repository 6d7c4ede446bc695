"""What these logs could show: the smallest size of each effect that the study would see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, Literal

import numpy as np

from mecanum_env.effects import CATALOGUE
from sysid.gap.library import Response
from sysid.gap.records import Untestable
from sysid.gap.thresholds import detectable_square

_NOTHING: Final = 0.1
"""A response shorter than this (in sigmas, over all samples) is none."""


def smallest_detectable(library: Sequence[Response], threshold: float) -> dict[str, dict[str, float]]:
    """Return effect -> parameter -> value that would be seen with 90 % probability.

    A parameter of which no value would is left out.

    Args:
        library: responses of the effects on these logs.
        threshold: gain of square sum that counts as seen.
    """
    needed = detectable_square(threshold)
    found: dict[str, dict[str, float]] = {}
    for name in dict.fromkeys(response.chosen.names[0] for response in library):
        own = [r for r in library if r.chosen.names[0] == name and not r.chosen.integral]
        for parameter in dict.fromkeys(r.chosen.coordinates[0].parameter for r in own):
            value = _smallest([r for r in own if r.chosen.coordinates[0].parameter == parameter], needed)
            if value is not None:
                found.setdefault(name, {})[parameter] = value
    return found


def untestable(
    considered: Sequence[str],
    library: Sequence[Response],
    detectable: Mapping[str, Mapping[str, float]],
    level: Literal["bench", "robot"],
) -> tuple[Untestable, ...]:
    """Return the effects that these logs could not show, with the reason.

    Args:
        considered: names of the effects that were tried.
        library: their responses.
        detectable: as `smallest_detectable` gives it.
        level: of the logs.
    """
    found = []
    for name, effect in CATALOGUE.items():
        if name in considered and name not in detectable:
            lengths = [float(np.linalg.norm(r.change)) for r in library if r.chosen.names[0] == name]
            seen = max(lengths, default=0.0) > _NOTHING
            reason = (
                "even the largest size of the search would change these logs by less than chance does"
                if seen
                else "no command in these logs brings it out: nothing measured depends on it"
            )
            found.append(Untestable(name, reason, {}))
        elif effect.simulated and level == "bench" and "bench" in effect.absent_from:
            found.append(Untestable(name, f"a bench log has no {effect.acts_on}: it takes a robot log", {}))
    return tuple(found)


def _smallest(own: Sequence[Response], needed: float) -> float | None:
    """Return the value of a parameter whose response is just long enough."""
    if own[0].linear:
        response = max(own, key=lambda r: float(np.linalg.norm(r.change)))
        length = float(np.linalg.norm(response.change))
        if length <= _NOTHING:
            return None
        first, place = response.chosen.coordinates[0], float(response.place[0])
        neutral = first.unit(first.neutral)
        at = neutral + (place - neutral) * np.sqrt(needed) / length
        return first.value(float(at)) if -1e-9 <= at <= 1.0 + 1e-9 else None
    # Sizes that were simulated, the nearest to neutral first; in between the length is taken to be straight.
    best: dict[float, float] = {}
    for response in own:
        length = float(np.linalg.norm(response.change))
        best[response.size] = max(best.get(response.size, 0.0), length)
    sizes = np.array([0.0, *sorted(best)])
    lengths = np.array([0.0, *(best[size] for size in sorted(best))])
    longest = np.maximum.accumulate(lengths)
    target = float(np.sqrt(needed))
    if longest[-1] < target:
        return None
    index = int(np.argmax(longest >= target))
    part = (target - longest[index - 1]) / max(longest[index] - longest[index - 1], 1e-12)
    size = sizes[index - 1] + part * (sizes[index] - sizes[index - 1])
    first = own[0].chosen.coordinates[0]
    neutral = first.unit(first.neutral) if np.isfinite(first.neutral) else 1.0
    direction = np.sign(float(own[0].place[0]) - neutral)
    return first.value(float(np.clip(neutral + direction * size, 0.0, 1.0)))
