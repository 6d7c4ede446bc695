"""The MuJoCo models of a `mecanum_env.model.Model`: robot on rollers, planar plant, bench."""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
