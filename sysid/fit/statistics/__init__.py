"""How good an estimate is and how certain: metrics, standard errors, residual tests, identifiability."""

from sysid.fit.statistics.identifiability import Quantity, weak_combinations
from sysid.fit.statistics.metrics import ErrorMetrics, MethodMetrics, Runs, method_metrics, residual, simulate
from sysid.fit.statistics.residuals import CorrelationTest, ResidualTests, residual_tests
from sysid.fit.statistics.standard_errors import Uncertainty, uncertainty

__all__ = [
    "CorrelationTest",
    "ErrorMetrics",
    "MethodMetrics",
    "Quantity",
    "ResidualTests",
    "Runs",
    "Uncertainty",
    "method_metrics",
    "residual",
    "residual_tests",
    "simulate",
    "uncertainty",
    "weak_combinations",
]
