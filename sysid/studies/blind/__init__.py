"""Blind tests of the gap workflow: hidden effects, found from logs and a nominal model alone."""

from sysid.studies.blind.cases import BlindTests, Case

__all__ = ["BlindTests", "Case"]
