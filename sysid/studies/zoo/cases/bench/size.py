"""How large the trace of a change in the logs is, and the size of a change that leaves a wanted trace."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from sysid.studies.zoo.cases.bench.change import with_controller, with_gear, with_link, with_sensor
from sysid.studies.zoo.cases.bench.plans import Commands
from sysid.studies.zoo.drives.drive import Drive
from sysid.studies.zoo.drives.simulate import Log, simulate

Apply = Callable[[Drive, float, np.random.Generator], Drive]
"""(drive, size from 0 to 1, rng) -> changed drive."""

TARGETS: Final = (0.05, 30.0)
"""Wanted traces, over the noise of repeats: from one that nobody can see to a gross one."""

_CLOSE: Final = 0.04
_HALVINGS: Final = 9
_FINE_COUNTS: Final = 1 << 24
_LEAST_NOISE_RPM: Final = 1e-3
"""Below this no log of the zoo repeats itself; it keeps a ratio finite."""


def noise_rpm(drive: Drive, commands: Sequence[Commands], seed: int) -> float:
    """Return the noise of repeats of a study [rpm]: the rms difference of two runs over root two.

    Both runs of each of the `commands` are independent; `seed` gives their luck.
    """
    squares = [
        _mean_square(simulate(drive, c, _rng(seed, 0, i)), simulate(drive, c, _rng(seed, 1, i)))
        for i, c in enumerate(commands)
    ]
    return max(math.sqrt(float(np.mean(squares)) / 2.0), _LEAST_NOISE_RPM)


def signal(before: Drive, after: Drive, commands: Sequence[Commands], seeds: Sequence[int]) -> float:
    """Return the rms of what a change does to the logs, over the noise of repeats.

    Noise that both drives have alike is left out of their difference, so that a trace far below it can be
    measured; noise that is the change itself (lost messages, a jittering delay, glitches) is not.

    Args:
        before: Nominal drive.
        after: Changed drive.
        commands: Command sequences of the study.
        seeds: Of the runs that the mean is taken over.
    """
    return float(np.mean([Yardstick(before, commands, seed)(after) for seed in seeds]))


@dataclass(frozen=True, eq=False)
class _Nominal:
    """Logs of the nominal drive without noise."""

    logs: list[Log]
    sensitivity_rpm2: float
    """Mean square of what an immeasurable change does: play that rattles never rattles twice alike."""


@dataclass(frozen=True, eq=False)
class Yardstick:
    """Measures the traces of changes of one drive in the logs of one study."""

    before: Drive
    commands: Sequence[Commands]
    seed: int
    _noise_rpm: list[float] = field(default_factory=list)
    _nominal: dict[Drive, _Nominal] = field(default_factory=dict)

    def __call__(self, after: Drive) -> float:
        """Return the trace of the change from the nominal drive to `after`, over the noise."""
        if not self._noise_rpm:
            self._noise_rpm.append(noise_rpm(self.before, self.commands, self.seed))
        plain, changed = without_common_noise(self.before, after)
        if changed == plain:
            return 0.0
        if plain not in self._nominal:
            self._nominal[plain] = self._run_nominal(plain)
        nominal = self._nominal[plain]
        square = _difference(nominal.logs, self._runs(changed)) - nominal.sensitivity_rpm2
        return math.sqrt(max(square, 0.0)) / self._noise_rpm[0] if math.isfinite(square) else math.inf

    def _run_nominal(self, plain: Drive) -> _Nominal:
        """Run the nominal drive, and once more with a change that no log can show."""
        logs = self._runs(plain)
        nearly = with_gear(plain, wheel_inertia_kg_m2=plain.gear.wheel_inertia_kg_m2 * (1.0 + 1e-6))
        return _Nominal(logs, _difference(logs, self._runs(nearly)))

    def _runs(self, drive: Drive) -> list[Log]:
        return [simulate(drive, c, _rng(self.seed, 2, i)) for i, c in enumerate(self.commands)]


def without_common_noise(before: Drive, after: Drive) -> tuple[Drive, Drive]:
    """Return both drives without the random parts that they have alike."""
    for part, change, quiet in _QUIET:
        old, new = getattr(before, part), getattr(after, part)
        same = {name: value for name, value in quiet.items() if getattr(old, name) == getattr(new, name)}
        # Counts that no drive has stay away; counts that both have become fine.
        same = {name: v for name, v in same.items() if "counts" not in name or getattr(old, name) > 0}
        before, after = change(before, **same), change(after, **same)
    return before, after


_QUIET: Final[tuple[tuple[str, Callable[..., Drive], dict[str, object]], ...]] = (
    ("link", with_link, {"jitter_s": 0.0, "loss": 0.0}),
    ("controller", with_controller, {"encoder_counts": _FINE_COUNTS}),
    (
        "sensor",
        with_sensor,
        {
            "counts": _FINE_COUNTS,
            "noise_rpm": 0.0,
            "outlier_share": 0.0,
            "held_share": 0.0,
            "resolution_rpm": 0.0,
            "stamps": "even",
            "jitter_s": 0.0,
        },
    ),
)
"""Part of a drive, how it is changed, and its values without noise."""


@dataclass(frozen=True)
class Solved:
    """A change of the size that leaves a wanted trace, or comes closest to it."""

    size: float
    drive: Drive
    """Changed."""
    signal: float


def solve_size(apply: Apply, drive: Drive, target: float, yardstick: Yardstick, key: Sequence[int]) -> Solved:
    """Return the change of a drive whose trace in the logs is the target, by bisection.

    The search ends at the gross size where that is still too small. `key` seeds what `apply` draws, so that
    all sizes are of one change.
    """

    def at(size: float) -> Solved:
        changed = apply(drive, size, np.random.default_rng(key))
        return Solved(size, changed, yardstick(changed))

    best = at(1.0)
    if best.signal <= target:
        return best
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = at(0.5 * (low + high))
        if log_distance(middle.signal, target) < log_distance(best.signal, target):
            best = middle
        if log_distance(best.signal, target) < _CLOSE:
            break
        low, high = (middle.size, high) if middle.signal < target else (low, middle.size)
    return best


def log_distance(reached: float, target: float) -> float:
    """Return how far a trace is `reached` from the wanted `target`, as a logarithm."""
    return abs(math.log(max(reached, 1e-9) / target)) if math.isfinite(reached) else math.inf


def _difference(some: Sequence[Log], others: Sequence[Log]) -> float:
    """Return the mean square of the difference of two studies [rpm2]."""
    return float(np.mean([_mean_square(a, b) for a, b in zip(some, others, strict=True)]))


def _mean_square(one: Log, other: Log) -> float:
    """Return the mean square of the difference of two logs of one command sequence, at common stamps."""
    here = one.speed_rpm
    there = other.speed_rpm
    if not np.array_equal(one.time_s, other.time_s):
        there = np.interp(one.time_s, other.time_s, there)
    return float(np.mean((here - there) ** 2))


def _rng(*key: int) -> np.random.Generator:
    return np.random.default_rng(key)
