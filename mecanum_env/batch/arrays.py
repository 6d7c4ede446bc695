"""Where a batch keeps its arrays: numpy's, or torch's on a device."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from mecanum_env.errors import InputError


class Arrays:
    """An array module and its device; copies and pickles hold the device alone.

    `device` is None for numpy, or one of torch's, such as "cpu" or "cuda".
    """

    def __init__(self, device: str | None = None) -> None:
        self.device = device
        self.xp: Any = np if device is None else _torch()

    def __reduce__(self) -> tuple[type[Arrays], tuple[str | None]]:
        return Arrays, (self.device,)

    def array(self, values: Any) -> Any:
        """Return numpy's `values` as an array of the module, of the same type of numbers."""
        if self.xp is np:
            return values
        return self.xp.asarray(np.ascontiguousarray(values), device=self.device)

    def numpy(self, values: Any) -> Any:
        """Return `values` of the module as numpy's."""
        return values if self.xp is np else values.cpu().numpy()


class OnArrays:
    """Something that computes with `Arrays`."""

    def __init__(self, arrays: Arrays) -> None:
        self._arrays = arrays

    @property
    def _xp(self) -> Any:
        return self._arrays.xp

    def _array(self, values: Any) -> Any:
        return self._arrays.array(values)


def _torch() -> ModuleType:
    """Return torch.

    Raises:
        InputError: it is not installed.
    """
    try:
        import torch
    except ImportError as error:
        raise InputError(
            "device: needs torch, `pip install torch`; without a device numpy computes"
        ) from error
    found: ModuleType = torch
    return found
