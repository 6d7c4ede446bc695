"""Controllers of the Mecanum robot: their training, evaluation, certificates and videos."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
