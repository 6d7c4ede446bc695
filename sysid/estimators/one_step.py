"""One-step-ahead least squares (equation error): the textbook baseline."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from mecanum_env.law.coefficients import WheelLaw
from sysid.estimators.interface import Estimate, Options, StartResult
from sysid.estimators.problem import stack
from sysid.estimators.runs import WheelRun
from sysid.estimators.start import one_step_coefficients


def one_step(runs: Sequence[WheelRun], options: Options | None = None) -> Estimate:
    """Estimate the law by predicting each speed from the three *measured* ones before it.

    Linear least squares, hence no starting point and no local minimum; but noise in the regressors biases it
    (Ljung, "System Identification", section 7.3), and nothing makes it stable. Samples between ticks are
    interpolated. Delay and saturation are not estimated.

    Args:
        runs: one or more runs.
        options: `unit_gain` is used.

    Raises:
        InputError: no usable data (see `problem.require_excitation`).
    """
    options = options or Options()
    began = time.perf_counter()
    problem = stack(runs)
    coefficients = one_step_coefficients(runs, unit_gain=options.unit_gain)
    law = WheelLaw.from_coefficients(coefficients, problem.sample_period_s)
    predicted = problem.predict(coefficients, problem.traces())
    residual = (predicted - problem.speed_rpm) * problem.weight
    with np.errstate(all="ignore"):
        cost = 0.5 * float(residual @ residual) + problem.within_cost
    seconds = time.perf_counter() - began
    start = StartResult(
        kind="one-step",
        initial=(),
        coefficients=tuple(float(x) for x in coefficients),
        rms_rpm=problem.rms(predicted),
        stable=law.is_stable,
        converged=True,
        iterations=1,
        seconds=seconds,
    )
    return Estimate(
        method="one-step",
        law=law,
        rms_rpm=start.rms_rpm,
        cost=cost if np.isfinite(cost) else np.inf,
        free=("A", "B", "C", "D", "F") if options.unit_gain else ("A", "B", "C", "D", "E", "F"),
        starts=(start,),
        seconds=seconds,
    )
