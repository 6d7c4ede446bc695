"""Drivers: one interface to robots over UDP, a serial line, or anything else."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
