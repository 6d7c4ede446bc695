"""The smallest size of each effect that some logs would show, and the effects that they cannot show.

An effect is seen if its response is long enough to pass what chance gains (`sysid.gap.search.chance`) with
probability `power`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Final

import numpy as np
from scipy.stats import norm

from mecanum_env.effects import CATALOGUE, Effect
from sysid.gap.result import Untestable
from sysid.gap.search.responses import Response
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.logs.runs import Level

_NO_RESPONSE: Final = 0.1
"""Length of a response, in noise sigmas over all samples, below which nothing measured depends on it."""


def smallest_detectable(
    library: Sequence[Response], threshold: float, least: Mapping[str, float]
) -> dict[str, dict[str, float]]:
    """Return effect -> parameter -> smallest value that would be seen with 90 % probability.

    Seen is what lowers the cost by a `threshold`, and by the `least` fall that an effect needs, if any. A
    parameter of which no value would be seen is left out. `library` holds the responses of the effects on
    these logs.
    """
    found: dict[str, dict[str, float]] = {}
    by_parameter: dict[tuple[str, str], list[Response]] = {}
    for response in library:
        if not any(coordinate.like for coordinate in response.chosen.coordinates):
            key = response.effect, response.chosen.coordinates[0].parameter
            by_parameter.setdefault(key, []).append(response)
    for (name, parameter), own in by_parameter.items():
        fall = max(threshold, least.get(name, 0.0))
        value = _smallest(own, float((np.sqrt(fall) + norm.ppf(THRESHOLDS.power)) ** 2))
        if value is not None:
            found.setdefault(name, {})[parameter] = value
    return found


def untestable(
    considered: Sequence[str],
    library: Sequence[Response],
    detectable: Mapping[str, Mapping[str, float]],
    level: Level,
    columns: Collection[str],
    *,
    command_falls: bool = True,
) -> tuple[Untestable, ...]:
    """Return which of the considered effects logs of a level could not show, with the reason.

    `library` holds their responses, `detectable` is from `smallest_detectable`; `columns` are those of the
    logs, and `command_falls` is as in `Dataset`.
    """
    found = []
    for name, effect in CATALOGUE.items():
        if name in considered and name not in detectable:
            lengths = [response.length for response in library if response.effect == name]
            found.append(Untestable(name, _unseen(effect, lengths), {}))
        elif not effect.unsearched_on and not effect.readable_in(columns):
            missing = " and ".join(column for column in effect.reads if column not in columns)
            found.append(Untestable(name, f"these logs have no {missing}, which it follows: log it", {}))
        elif level == "bench" and effect.needs_falling_command and not command_falls:
            reason = (
                "no command of these logs falls or reverses, and a gap that is passed once, at the start, is "
                "no other than a delay: drive reversals"
            )
            found.append(Untestable(name, reason, {}))
        elif effect.simulated and level == "bench" and "bench" in effect.absent_from:
            found.append(Untestable(name, f"a bench log has no {effect.acts_on}: record a robot log", {}))
        elif level == "bench" and name == effect.cause and effect.unsearched_on == ("bench",):
            reason = "a bench log does not tell it from the friction that it makes larger: record a robot log"
            found.append(Untestable(name, reason, {}))
    return tuple(found)


def _unseen(effect: Effect, lengths: Sequence[float]) -> str:
    """Return why logs could not show an effect, from how much each size that was simulated changes them."""
    if not lengths:
        return "no size of it could be simulated with this model"
    if max(lengths) > _NO_RESPONSE:
        return (
            "even the largest size of the search would change these logs by less than noise or the "
            "model's own error does"
        )
    return f"no measured channel responds to it under the {_given(effect)} of these logs"


def _given(effect: Effect) -> str:
    """Return what an effect needs to show, in words."""
    return " and ".join(("commands", *effect.reads))


def _smallest(own: Sequence[Response], needed: float) -> float | None:
    """Return the value of a parameter whose response has the squared length `needed`, None if none has."""
    if own[0].linear:
        response = max(own, key=lambda r: r.length)
        if response.length <= _NO_RESPONSE:
            return None
        first, neutral = response.chosen.coordinates[0], response.chosen.coordinates[0].neutral_place
        at = neutral + (float(response.place[0]) - neutral) * np.sqrt(needed) / response.length
        return first.value(float(at)) if -1e-9 <= at <= 1.0 + 1e-9 else None
    # Linear interpolation between the sizes that were simulated.
    best: dict[float, float] = {}
    for response in own:
        best[response.size] = max(best.get(response.size, 0.0), response.length)
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
    direction = np.sign(float(own[0].place[0]) - first.neutral_place)
    return first.value(float(np.clip(first.neutral_place + direction * size, 0.0, 1.0)))
