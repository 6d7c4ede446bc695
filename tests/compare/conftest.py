"""The bench logs with known truth that the tests of the gap use, too."""

from tests.gap.conftest import base, bench_logs

__all__ = ["base", "bench_logs"]
