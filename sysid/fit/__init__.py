"""Fitting the wheel law to logs: `fit_dataset` is the library, ``python -m sysid.fit LOGS`` the program."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
