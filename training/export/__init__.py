"""Trained policies as files that need none of this package: an ONNX graph, a C header, and their contract."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
