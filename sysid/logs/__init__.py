"""Logs of wheels and robots: reading them strictly, and reporting what is odd in them.

`read_dataset` is the entry point; the folder format is section 1 of FORMATS.md.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
