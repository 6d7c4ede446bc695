"""Blind tests of the gap workflow: hidden effects, found from logs and a nominal model alone."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
