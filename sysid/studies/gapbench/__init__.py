"""GapBench: a public benchmark for naming the effect that a simulator lacks, and methods that try."""
