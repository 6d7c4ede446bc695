"""The supply's voltage during a run, as it was logged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mecanum_env.units import FloatArray


@dataclass(frozen=True, eq=False)
class Supply:
    """The voltage at some times of a run."""

    time_s: FloatArray
    """Times from the start of the run on [s], increasing, shape (n,), n >= 1."""
    voltage_v: FloatArray
    """Finite voltages [V], shape (n,)."""
    full_v: float | None = None
    """The full voltage [V]; None: the first one."""

    @staticmethod
    def logged(
        time_s: FloatArray, voltage_v: FloatArray | None, full_v: float | None = None
    ) -> Supply | None:
        """Return the supply of a log's column, shape (n,), with NaN where a sample is missing.

        It is None without the column, or if none of its samples is finite; `full_v` is as above.
        """
        if voltage_v is None:
            return None
        finite = np.isfinite(voltage_v)
        return Supply(time_s[finite], voltage_v[finite], full_v) if np.any(finite) else None

    def later(self, seconds: float) -> Supply:
        """Return the supply of a run that starts some time [s] before this one."""
        return Supply(self.time_s + seconds, self.voltage_v, self.full_v)

    def lost_at(self, time_s: FloatArray) -> FloatArray:
        """Return by how many volts the supply is below the full voltage at times (m,) [s].

        The voltage is linear between samples, and holds before the first and behind the last.
        """
        full = self.voltage_v[0] if self.full_v is None else self.full_v
        return np.asarray(full - np.interp(time_s, self.time_s, self.voltage_v))
