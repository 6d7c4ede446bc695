"""The uncertainty of an estimate: standard errors, Cramer-Rao bounds, residual tests, identifiability."""

from sysid.fit.statistics.identifiability import Quantity, weak_combinations
from sysid.fit.statistics.residuals import CorrelationTest, ResidualTests, residual_tests
from sysid.fit.statistics.uncertainty import Uncertainty, noise_sigma, uncertainty

__all__ = [
    "CorrelationTest",
    "Quantity",
    "ResidualTests",
    "Uncertainty",
    "noise_sigma",
    "residual_tests",
    "uncertainty",
    "weak_combinations",
]
