"""Support for tests, benchmarks and the paper's experiments; no part of the path from logs to a model."""
