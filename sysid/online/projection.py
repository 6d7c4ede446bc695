"""The projection that keeps every published law within the limits of the options.

L. Ljung and T. Soderstrom, "Theory and Practice of Recursive Identification" (1983), section 6.6: a recursive
prediction error method converges only if its estimates stay where the predictor is stable. There, a step that
leaves the region is shortened; here, its poles are contracted first, which keeps more of the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from mecanum_env.law import WheelLaw
from mecanum_env.units import FloatArray
from sysid.online.options import OnlineOptions

_BISECTIONS: Final = 40
_HALVINGS: Final = 10


def free_parameters(law: WheelLaw) -> FloatArray:
    """Return (A, B, C, D, F) of `law`, shape (5,): E follows from unit DC gain."""
    return np.array([law.A, law.B, law.C, law.D, law.F])


def law_of(parameters: FloatArray, sample_period_s: float) -> WheelLaw:
    """Return the law of `parameters` (A, B, C, D, F); its six sum to 1 (see `WheelLaw.normalised`)."""
    a, b, c, d, f = parameters.tolist()
    return WheelLaw(a, b, c, d, 1.0 - (a + b + c + d + f), f, sample_period_s)


def poles_within(abc: Sequence[float], radius: float) -> bool:
    """Return whether all roots of z^3 - A z^2 - B z - C, `abc` = (A, B, C), lie within `radius`.

    Multiplying A, B, C by 1/radius, 1/radius^2, 1/radius^3 divides the roots by the radius.
    """
    a, b, c = abc[0] / radius, abc[1] / radius**2, abc[2] / radius**3
    # `stability_margins` in scalars, 20 times faster for one law; a test compares the two.
    margins = (1 - a - b - c, 3 + a + b - 3 * c, 1 + a - b + c, 1 + b + a * c - c * c)
    return min(margins) > 0.0


def contracted(abc: Sequence[float], radius: float) -> Sequence[float]:
    """Return `abc` = (A, B, C) with all poles scaled by one factor so that the largest lies within `radius`.

    If all are within, nothing changes. A common factor keeps the poles' angles and ratios.
    """
    if poles_within(abc, radius):
        return abc
    a, b, c = abc
    inside, outside = 0.0, 1.0
    for _ in range(_BISECTIONS):
        g = 0.5 * (inside + outside)
        if poles_within((a * g, b * g**2, c * g**3), radius):
            inside = g
        else:
            outside = g
    return a * inside, b * inside**2, c * inside**3


def feasible_step(parameters: FloatArray, step: FloatArray, options: OnlineOptions) -> FloatArray:
    """Return the new (A, B, C, D, F), shape (5,), after as much of `step` as the limits in `options` allow.

    Poles that leave the circle of `largest_pole` are contracted. If D, E or F then exceeds
    `largest_numerator`, the step is halved, and abandoned after ten halvings. `parameters` must be within the
    limits, and so is the result.
    """
    for halving in range(_HALVINGS):
        new = parameters + step * 0.5**halving
        new[:3] = contracted(new[:3].tolist(), options.largest_pole)
        if _numerator_within(new, options.largest_numerator):
            return new
    return parameters.copy()


def feasible_start(parameters: FloatArray, options: OnlineOptions) -> FloatArray:
    """Return parameters within the limits of `options` near `parameters`, to start from.

    The poles are contracted, and D, E, F are made equal if one is too large.
    """
    new = parameters.copy()
    new[:3] = contracted(new[:3].tolist(), options.largest_pole)
    if not _numerator_within(new, options.largest_numerator):
        new[3:] = (1.0 - float(np.sum(new[:3]))) / 3.0
    if not _numerator_within(new, options.largest_numerator):
        new[:] = 0.0
        new[3] = min(1.0, options.largest_numerator)
    return new


def _numerator_within(parameters: FloatArray, limit: float) -> bool:
    a, b, c, d, f = parameters.tolist()
    return bool(max(abs(d), abs(f), abs(1.0 - (a + b + c + d + f))) <= limit)
