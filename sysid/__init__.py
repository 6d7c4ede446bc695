"""System identification: from logs of a wheel or robot to a `model.json`, and the gap between the two."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
