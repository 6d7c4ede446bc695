"""How sure an estimate is: standard errors, Cramer-Rao bounds, residual tests, identifiability."""

from sysid.statistics.identifiability import weak_combinations
from sysid.statistics.quantity import Quantity
from sysid.statistics.residuals import InputCorrelation, ResidualTests, Whiteness, residual_tests
from sysid.statistics.uncertainty import Uncertainty, noise_sigma, uncertainty

__all__ = [
    "InputCorrelation",
    "Quantity",
    "ResidualTests",
    "Uncertainty",
    "Whiteness",
    "noise_sigma",
    "residual_tests",
    "uncertainty",
    "weak_combinations",
]
