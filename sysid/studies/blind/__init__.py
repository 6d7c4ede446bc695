"""Blind tests of the gap workflow: hidden effects, found from logs and a nominal model alone."""

from typing import TYPE_CHECKING

from mecanum_env.lazy import lazy_exports

if TYPE_CHECKING:
    from sysid.studies.blind.cases import BlindTests, Case
else:
    __getattr__, __dir__ = lazy_exports(__name__, __file__)

__all__ = ["BlindTests", "Case"]
