"""The six coefficients A-F of the wheel law, its poles, stability margins and simulation.

    w(k+1) = A w(k) + B w(k-1) + C w(k-2) + D r(k) + E r(k-1) + F r(k-2)

with w the wheel speed and r the commanded speed [rpm], every `sample_period_s` (Nie, Igo and Hoshino,
"Parameter identification of Mecanum wheel robot using descent with stability criterion").
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError, UnstableLawError
from mecanum_env.law.arrays import floats
from mecanum_env.law.stability import stability_margins
from mecanum_env.units import FloatArray

COEFFICIENTS: Final = ("A", "B", "C", "D", "E", "F")


def law_step(
    coefficients: Sequence[float] | Sequence[FloatArray],
    speeds: Sequence[FloatArray],
    commands: Sequence[FloatArray],
) -> FloatArray:
    """Return w(k+1) [rpm] from the `coefficients` A-F, the speeds w(k), w(k-1), w(k-2) and the commands r.

    The arrays are of either kind of `mecanum_env.law.arrays`. The order of the additions is part of the
    definition: the C plugin repeats it, and tests hold the two equal bit for bit.
    """
    a, b, c, d, e, f = coefficients
    w0, w1, w2 = speeds
    r0, r1, r2 = commands
    after: FloatArray = floats(a * w0 + b * w1 + c * w2 + d * r0 + e * r1 + f * r2)
    return after


@dataclass(frozen=True)
class LawState:
    """Memory of the law between ticks [rpm]: w(k), w(k-1), w(k-2), r(k-1), r(k-2).

    Fields may be arrays of one common shape, with one entry for each wheel or run.
    """

    w0: npt.ArrayLike = 0.0
    w1: npt.ArrayLike = 0.0
    w2: npt.ArrayLike = 0.0
    r1: npt.ArrayLike = 0.0
    r2: npt.ArrayLike = 0.0

    @staticmethod
    def steady(speed_rpm: npt.ArrayLike) -> LawState:
        """Return the state of a wheel that has settled at a speed [rpm], if the law has unit DC gain."""
        return LawState(speed_rpm, speed_rpm, speed_rpm, speed_rpm, speed_rpm)


@dataclass(frozen=True)
class WheelLaw:
    """Coefficients A-F (dimensionless) of a law that ticks every `sample_period_s` [s].

    Raises:
        InputError: a coefficient is not finite, or the period is not positive.
    """

    A: float
    B: float
    C: float
    D: float
    E: float
    F: float
    sample_period_s: float

    def __post_init__(self) -> None:
        for name in (*COEFFICIENTS, "sample_period_s"):
            value = getattr(self, name)
            if not math.isfinite(value):
                raise InputError(f"wheel law: {name} = {value}, must be a finite number")
        if self.sample_period_s <= 0.0:
            raise InputError(f"wheel law: sample_period_s = {self.sample_period_s}, must be above 0")

    @property
    def coefficients(self) -> FloatArray:
        """A-F as an array, shape (6,)."""
        return np.array([self.A, self.B, self.C, self.D, self.E, self.F])

    @staticmethod
    def from_coefficients(coefficients: npt.ArrayLike, sample_period_s: float) -> WheelLaw:
        """Build a law from its six coefficients in the order A-F.

        Raises:
            InputError: not six numbers, or as for the law itself.
        """
        values = np.asarray(coefficients, float)
        if values.shape != (6,):
            raise InputError(f"wheel law: coefficients of shape {values.shape}, must be the six numbers A-F")
        a, b, c, d, e, f = (float(x) for x in values)
        return WheelLaw(a, b, c, d, e, f, float(sample_period_s))

    @property
    def dc_gain(self) -> float:
        """Steady speed over constant command: 1 with integral action, nan with a pole at z = 1."""
        denominator = 1.0 - self.A - self.B - self.C
        return (self.D + self.E + self.F) / denominator if denominator != 0.0 else math.nan

    @property
    def poles(self) -> npt.NDArray[np.complex128]:
        """The three roots of z^3 - A z^2 - B z - C, shape (3,), largest magnitude first."""
        roots = np.roots([1.0, -self.A, -self.B, -self.C]).astype(np.complex128)
        return roots[np.argsort(-np.abs(roots), kind="stable")]

    @property
    def margins(self) -> FloatArray:
        """The four stability margins, shape (4,); see `mecanum_env.law.stability.stability_margins`."""
        return stability_margins([self.A, self.B, self.C])

    @property
    def is_stable(self) -> bool:
        """True when every pole lies inside the unit circle."""
        return bool(np.all(self.margins > 0.0))

    def require_stable(self) -> WheelLaw:
        """Return self.

        Raises:
            UnstableLawError: a pole lies on or outside the unit circle; the message lists the poles.
        """
        if not self.is_stable:
            shown = ", ".join(f"{p.real:.6g}{p.imag:+.6g}j (|z| {abs(p):.6g})" for p in self.poles)
            raise UnstableLawError(
                f"the wheel law is unstable: poles {shown}; all magnitudes must be below 1. "
                "Fit it again with `python -m sysid.fit LOGS`, which is stable by construction"
            )
        return self

    def normalised(self) -> WheelLaw:
        """Return the law with E changed so that A+B+C+D+E+F = 1: unit DC gain, as its derivation implies."""
        return replace(self, E=1.0 - (self.A + self.B + self.C + self.D + self.F))

    def moved(self, change: Sequence[float]) -> WheelLaw:
        """Return the law with A-F changed by six numbers, but with the same sum, which keeps its gain."""
        numbers = {name: getattr(self, name) + d for name, d in zip(COEFFICIENTS, change, strict=True)}
        numbers["E"] -= sum(change)
        return replace(self, **numbers)

    def tick(self, state: LawState, command_rpm: npt.ArrayLike) -> tuple[FloatArray, LawState]:
        """Advance one tick: return w(k+1) [rpm] and the next state for r(k) = `command_rpm`."""
        w0, w1, w2 = (np.asarray(x, float) for x in (state.w0, state.w1, state.w2))
        r0, r1, r2 = (np.asarray(x, float) for x in (command_rpm, state.r1, state.r2))
        after = law_step((self.A, self.B, self.C, self.D, self.E, self.F), (w0, w1, w2), (r0, r1, r2))
        return after, LawState(after, w0, w1, r0, r1)

    def simulate(self, command_rpm: npt.ArrayLike, initial: LawState | None = None) -> FloatArray:
        """Return the speeds w(0..N) [rpm], shape (..., N+1), for commands r(0..N-1) [rpm], shape (..., N).

        w(0) is the speed of the `initial` state; None starts at rest. Leading axes are independent runs;
        those of the commands and of the state's fields are broadcast against each other.
        """
        commands = np.asarray(command_rpm, float)
        state = LawState() if initial is None else initial
        runs = np.broadcast_shapes(
            commands.shape[:-1], *(np.shape(getattr(state, f.name)) for f in fields(state))
        )
        speeds = np.empty((*runs, commands.shape[-1] + 1))
        speeds[..., 0] = state.w0
        for k in range(commands.shape[-1]):
            speeds[..., k + 1], state = self.tick(state, commands[..., k])
        return speeds
