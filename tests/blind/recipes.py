"""What makers of cases share: an entry of the list with the mechanism that stays hidden."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sysid.studies.blind.cases import Case

Fields = dict[str, float]
Truth = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Recipe:
    """A case, and the fields of the simulator that hide it."""

    case: Case
    hidden: Fields
    gentle: bool = False
    """Commands that leave much untested."""

    def rng(self, seed: int) -> np.random.Generator:
        """Return the case's own random numbers, whatever other cases there are."""
        return np.random.default_rng([seed, zlib.crc32(self.case.name.encode())])


def drawn(rng: np.random.Generator, low: float, high: float, digits: int = 3) -> float:
    """Return a number between two, to so many significant digits."""
    return float(f"{rng.uniform(low, high):.{digits}g}")


def factor(rng: np.random.Generator, low: float, high: float) -> float:
    """Return 1 plus or minus a share between two."""
    return round(1.0 + float(rng.choice([-1.0, 1.0])) * rng.uniform(low, high), 4)
