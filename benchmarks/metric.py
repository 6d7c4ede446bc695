"""A measured number with its target: what `benchmarks/env.py` and `benchmarks/physics.py` report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Metric:
    """A measured number and the range that it should be in; without bounds it is for information only."""

    name: str
    value: float
    unit: str = ""
    low: float | None = None
    high: float | None = None

    @property
    def verdict(self) -> str:
        """The word ok or MISSED; empty without a target."""
        if self.low is None and self.high is None:
            return ""
        above = self.low is None or self.value >= self.low
        return "ok" if above and (self.high is None or self.value <= self.high) else "MISSED"

    @property
    def target(self) -> str:
        """The bounds as text; empty without a target."""
        if self.low is not None and self.high is not None:
            return f"{self.low:.5g} .. {self.high:.5g}"
        return f">= {self.low:.5g}" if self.low is not None else f"<= {self.high:.5g}" if self.high else ""


def print_metrics(metrics: Sequence[Metric]) -> None:
    """Print each metric beside its target and verdict."""
    width = max(len(metric.name) for metric in metrics)
    for metric in metrics:
        value = f"{metric.value:.5g} {metric.unit}"
        print(f"{metric.name:{width}}  {value:>20}  {metric.target:>18}  {metric.verdict}")


def metric_rows(metrics: Sequence[Metric]) -> list[dict[str, Any]]:
    """Return the metrics as JSON objects, each with its verdict."""
    return [{**asdict(metric), "verdict": metric.verdict} for metric in metrics]
