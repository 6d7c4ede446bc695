"""The bias that curvature gives a least-squares estimate, to second order in the noise."""

from __future__ import annotations

from typing import Final

import numpy as np

from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.units import FloatArray
from sysid.statistics.linearised import Linearised

_STEP: Final = 0.2
"""Step of the second differences, in standard deviations of each direction."""


def second_order_bias(at: Linearised) -> FloatArray:
    """Return the expected error of the named parameters for the given sigmas, shape (q,).

    M. J. Box, "Bias in nonlinear estimation", J. Royal Statistical Society B 33 (1971):
    bias = -1/2 (J^T J)^-1 J^T m with m_i = trace(covariance x Hessian of prediction i). It falls with the
    noise variance, so beside the standard error it vanishes as data grow; delay and saturation count as
    linear.
    nan where a law within `_STEP` standard deviations is unstable.
    """
    law, problem = at.value[:6], at.problem
    centre = problem.predict(law, at.traces)
    curvature = np.zeros_like(centre)
    for direction in at.factor[:6].T:
        sides = [law + sign * _STEP * direction for sign in (1.0, -1.0)]
        if not all(WheelLaw.from_coefficients(side, problem.sample_period_s).is_stable for side in sides):
            return np.full(len(at.names), np.nan)
        up, down = (problem.predict(side, at.traces) for side in sides)
        curvature += (up - 2.0 * centre + down) / _STEP**2
    return np.asarray(-0.5 * at.factor @ (at.basis.T @ (curvature * problem.weight)))
