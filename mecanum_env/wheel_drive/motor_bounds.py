"""What the torque of a motor and its supply leave of the law's step from one tick to the next.

The law says which speed w(k+1) it wants from w(k). A motor of limited torque changes the speed by no more
than some amount per tick, another one where it slows the wheel. A motor at full voltage has a torque that
falls in a straight line with speed, to 0 at the speed n at which its back-EMF uses the supply up:

    -s (n + w(k)) <= w(k+1) - w(k) <= s (n - w(k))

with s = 1 - exp(-tick / T) for a motor that has the time constant T at constant voltage or, where that is not
known, the share of a step that the law itself covers in its fastest tick (`steepest_share`): the motor of a
law that is not limited must be able to do that. A law of first order then ends at n as it ends at any speed;
others bend towards it. As s <= 1, the wheel never passes n. Where the voltage is known, n falls with it
(`supplied`).

The law's memory holds the speeds w that were reached, since its past outputs are the wheel's speeds: nothing
winds up while a bound acts, unless the law has a `windup`. In its next tick it then asks for that share of
what was beyond the bounds, too. With a share of 1 this is a PI controller without anti-windup on a motor of
first order: to its last output, limited or not, such a controller adds what the last errors call for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.law.arrays import floats, namespace
from mecanum_env.law.coefficients import LawState, WheelLaw
from mecanum_env.units import FloatArray

_SETTLED: Final = 1e-4
"""Size of the slowest part of a step response behind which no fastest tick is looked for."""
_MOST_TICKS: Final = 20_000
_LEAST_SUPPLY: Final = 1e-3
"""Share of the speed n that is left at any voltage."""
_STEADY_TORQUE: Final = np.array([2.0, -1.0, 0.0])
"""A, B and C of a wheel whose torque stays as it was in the tick before: w(k+1) - w(k) = w(k) - w(k-1)."""


@dataclass(frozen=True)
class MotorBounds:
    """Bounds on what a wheel's speed changes by in one tick of its law; infinite without one."""

    rise_rpm: float = math.inf
    """Largest change away from rest [rpm]."""
    brake_rpm: float = math.inf
    """Largest change towards rest [rpm], also where the wheel passes through rest within the tick."""
    supply_rpm: float = math.inf
    """Speed n at which the supply leaves no torque [rpm]."""
    supply_share: float = 0.0
    """Share s of n - w(k) that the wheel gains in a tick at full voltage."""
    supply_per_volt: float = 0.0
    """Share of n that is lost with each volt of the supply below that at the start [1/V]."""
    windup: float = 0.0
    """Share of what the law asks beyond the bounds that it asks for again in its next tick."""

    @property
    def acts(self) -> bool:
        """Whether there is any bound."""
        return any(map(math.isfinite, (self.rise_rpm, self.brake_rpm, self.supply_rpm)))

    def reached(
        self, speed_rpm: npt.ArrayLike, wanted_rpm: npt.ArrayLike, lost_v: npt.ArrayLike = 0.0
    ) -> FloatArray:
        """Return w(k+1) [rpm] where the law wants some speed, from w(k) = `speed_rpm`, of one shape.

        `lost_v` is the voltage that the supply has lost [V], of a shape that broadcasts.
        """
        speed, wanted = np.asarray(speed_rpm, float), np.asarray(wanted_rpm, float)
        supply = supplied(np.asarray(self.supply_rpm), self.supply_per_volt, lost_v)
        bounds = (self.rise_rpm, self.brake_rpm, supply, self.supply_share)
        return bounded(speed, wanted, *map(np.asarray, bounds)) if self.acts else wanted

    def tick(
        self,
        law: WheelLaw,
        state: LawState,
        command_rpm: npt.ArrayLike,
        excess_rpm: npt.ArrayLike = 0.0,
        lost_v: npt.ArrayLike = 0.0,
    ) -> tuple[LawState, FloatArray]:
        """Return the law's next state, whose w0 is the speed reached, and what was beyond the bounds [rpm].

        `command_rpm` is r(k), and `excess_rpm` what was beyond the bounds in the last tick.
        """
        asked, after = law.tick(state, command_rpm)
        wanted = asked + self.windup * np.asarray(excess_rpm, float)
        reached = self.reached(state.w0, wanted, lost_v)
        return LawState(reached, after.w1, after.w2, after.r1, after.r2), wanted - reached

    def simulate(
        self, law: WheelLaw, command_rpm: FloatArray, initial: LawState, lost_v: npt.ArrayLike = 0.0
    ) -> FloatArray:
        """Return the speeds w(0..N) [rpm], shape (..., N+1), as `WheelLaw.simulate`, but bounded.

        `lost_v` is the voltage that the supply has lost at each tick [V], of a shape that broadcasts to that
        of the commands, (..., N).
        """
        if not self.acts:
            return law.simulate(command_rpm, initial)
        state, speeds = initial, [np.broadcast_to(initial.w0, command_rpm.shape[:-1])]
        lost, excess = np.broadcast_to(lost_v, command_rpm.shape), np.zeros(command_rpm.shape[:-1])
        for k in range(command_rpm.shape[-1]):
            state, excess = self.tick(law, state, command_rpm[..., k], excess, lost[..., k])
            speeds.append(np.asarray(state.w0))
        return np.stack(speeds, axis=-1)


def bounded(
    speed: FloatArray,
    wanted: FloatArray,
    rise: FloatArray,
    brake: FloatArray,
    supply: FloatArray,
    supply_share: FloatArray,
) -> FloatArray:
    """Return w(k+1) [rpm] where laws want the speeds `wanted`, from w(k) = `speed`; all shapes broadcast.

    Arrays may be of either kind of `mecanum_env.law.arrays`. The bounds are those of `MotorBounds`: `rise`
    and `brake` [rpm], `supply` [rpm] and `supply_share`.
    """
    xp = namespace(speed)
    up, down = xp.where(speed < 0.0, brake, rise), xp.where(speed > 0.0, brake, rise)
    low = xp.where(xp.isinf(down), wanted, speed - down)
    high = xp.where(xp.isinf(up), wanted, speed + up)
    limited = xp.isfinite(supply)
    ceiling = xp.where(limited, supply, 0.0)
    low = xp.where(limited, xp.maximum(low, speed - supply_share * (ceiling + speed)), low)
    high = xp.where(limited, xp.minimum(high, speed + supply_share * (ceiling - speed)), high)
    reached: FloatArray = xp.where(wanted < low, low, xp.where(wanted > high, high, wanted))
    return reached


def supplied(supply: FloatArray, per_volt: npt.ArrayLike, lost_v: npt.ArrayLike) -> FloatArray:
    """Return the speeds n [rpm] at a supply that has lost some volts; all shapes broadcast.

    `supply` are those at the start, which may be infinite; `per_volt` are as in `MotorBounds`.
    """
    lost = lost_v if isinstance(lost_v, float) else floats(lost_v)
    left = 1.0 - floats(per_volt) * lost
    speeds: FloatArray = floats(supply * namespace(left).clip(left, _LEAST_SUPPLY, None))
    return speeds


@lru_cache(maxsize=1024)
def steepest_share(law: WheelLaw) -> float:
    """Return the largest change in one tick of a law's response to a unit step, at most 1.

    Raises:
        InputError: the response never rises.
    """
    slowest = min(float(np.max(np.abs(law.poles))), 1.0 - 1e-9)
    ticks = math.log(_SETTLED) / math.log(slowest) if slowest > 0.0 else 0.0
    speeds = law.simulate(np.ones(min(math.ceil(ticks) + 4, _MOST_TICKS)))
    share = float(np.max(np.diff(speeds)))
    if not share > 0.0:
        raise InputError("the wheel law does not follow its command, so that no supply can limit it")
    return min(share, 1.0)


def loaded_law(law: WheelLaw, ratio: float, *, integral: bool = False) -> WheelLaw:
    """Return the law of a wheel whose moment of inertia is `ratio` times as large, under the same controller.

    A law N(z) / P(z) of gain 1 is the loop of a wheel 1 / (z - 1) under a drive whose torque follows from the
    error u - w by (z - 1) N / (P - N), since z - 1 divides P - N. A heavier wheel divides what the torque
    does, and thereby N, by `ratio`: N' = N / ratio, P' = P - (1 - 1 / ratio) N. With another gain g the drive
    follows g u, so that N / g stands for N in P'.
    With `integral` action the drive may answer commands and speeds separately, as with a derivative of the
    speed; this answer is added to the torque of the tick before, which gives (w(k) - w(k-1)) of a heavier
    wheel: w(k+1) = 2 w(k) - w(k-1) + (law's w(k+1) - 2 w(k) + w(k-1)) / ratio. Either keeps the gain.

    Raises:
        UnstableLawError: the drive does not hold such a wheel at a speed.
    """
    if ratio == 1.0:
        return law
    lost, of_speed, of_command = 1.0 - 1.0 / ratio, law.coefficients[:3], law.coefficients[3:]
    gained = _STEADY_TORQUE - of_speed if integral else of_command / law.dc_gain
    changed = [*(of_speed + lost * gained), *(of_command / ratio)]
    return WheelLaw.from_coefficients(changed, law.sample_period_s).require_stable()
