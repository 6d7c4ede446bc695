"""Fits of candidates to logs: the whitened residual of a model, and its descent with few simulations."""

from sysid.compare.least_squares.fitted import (
    PRIOR,
    Fitted,
    base_fit,
    fit,
    function_near,
    held_starts,
    marginal_function,
)
from sysid.compare.least_squares.from_afar import descend_from_afar, descend_from_many
from sysid.compare.least_squares.gauss_newton import (
    Minimum,
    compass_search,
    derivative_free,
    descend_steeply,
    reach,
)
from sysid.compare.least_squares.phases import FREQUENCIES, at_likeliest_phase, likely_frequencies
from sysid.compare.least_squares.problem import SMOOTH_STEP, ResidualProblem

__all__ = [
    "FREQUENCIES",
    "PRIOR",
    "SMOOTH_STEP",
    "Fitted",
    "Minimum",
    "ResidualProblem",
    "at_likeliest_phase",
    "base_fit",
    "compass_search",
    "derivative_free",
    "descend_from_afar",
    "descend_from_many",
    "descend_steeply",
    "fit",
    "function_near",
    "held_starts",
    "likely_frequencies",
    "marginal_function",
    "reach",
]
