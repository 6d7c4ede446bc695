"""Methods that identify the wheel law from runs, all behind one function: `estimate`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from mecanum_env.errors import InputError, did_you_mean
from sysid.fit.estimators.exhaustive import SearchGrid, exhaustive
from sysid.fit.estimators.gradient import gradient, kkt, pole_discrimination, random_starts
from sysid.fit.estimators.interface import (
    SUCCESS_RATIO,
    CommandSource,
    Estimate,
    Method,
    Options,
    StartResult,
    WheelRun,
)
from sysid.fit.estimators.linear import one_step
from sysid.fit.estimators.output_error import output_error

METHODS: Final[Mapping[str, Method]] = {
    "output-error": output_error,
    "one-step": one_step,
    "kkt": kkt,
    "gradient": gradient,
    "poles": pole_discrimination,
    "exhaustive": exhaustive,
}
"""Every method by the name that `--method` takes."""

DEFAULT_METHOD: Final = "output-error"

__all__ = [
    "DEFAULT_METHOD",
    "METHODS",
    "SUCCESS_RATIO",
    "CommandSource",
    "Estimate",
    "Method",
    "Options",
    "SearchGrid",
    "StartResult",
    "WheelRun",
    "estimate",
    "exhaustive",
    "random_starts",
]


def estimate(
    runs: Sequence[WheelRun], method: str = DEFAULT_METHOD, options: Options | None = None
) -> Estimate:
    """Identify the wheel law.

    `method` is a name in `METHODS`; runs of several wheels are pooled into one law.

    Raises:
        InputError: an unknown method, or data that cannot be fitted; the message says why.
    """
    if method not in METHODS:
        raise InputError(
            f"method {method!r}: unknown{did_you_mean(method, METHODS)}; known: {', '.join(METHODS)}"
        )
    return METHODS[method](runs, options or Options())
