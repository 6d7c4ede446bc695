"""What is random in an episode: the draws at its start, and the noise of its observations.

`Chance.draw` draws all of it from the environment's own generator, always in the same order. Everything after
that is deterministic, so an episode does not depend on the environments that run beside it.

The noise of an episode follows from its seed by a hash (`mecanum_env.wheel_drive.link`) and the transform of
Box and Muller (1958), so that it depends neither on the episodes beside it nor on when it is made. It is made
when it is needed, since most episodes end long before their time limit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from mecanum_env.tankendo.constants import Opponent, Rules
from mecanum_env.tankendo.numbers import Number, mathematics
from mecanum_env.tankendo.opponents import Opponents
from mecanum_env.tankendo.scene import RowArray
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.link import MOST_SEEDS, hashed

EXCHANGES: Final = 16
"""Number of strikes drawn for an episode; a duel with more of them starts over with the first."""
WAVES: Final = 3
"""Number of sine waves, along each axis, that make up the opponent's walk in the tracking task."""

_NOISE_STEPS: Final = 16
"""Steps whose noise is made at a time."""

# Made once: for the few numbers of one episode, numpy makes a scalar as slowly as it computes.
_HALF, _LOWER = np.uint64(32), np.uint64(0xFFFFFFFF)
_MIDDLE, _MINUS_TWO, _SHARE = np.float32(0.5), np.float32(-2.0), np.float32(2.0**-32)
_ANGLE = np.float32(2.0 * np.pi * 2.0**-32)

# Counts of the uniform draws: for the start, for each wave (frequency, phase), for each exchange.
_START, _PER_WAVE, _PER_EXCHANGE = 6, 2, 6
_UNIFORM = _START + 2 * WAVES * _PER_WAVE + EXCHANGES * _PER_EXCHANGE
# Lowest frequency [rad/s] and phase [rad] of a wave, and how much the highest ones are above them.
_LOWEST_WAVE, _MORE_WAVE = np.array([0.5, 0.0])[:, None], np.array([1.5, 2.0 * np.pi])[:, None]
_EPISODE = (
    *("start_pose", "start_distance", "drift", "waves", "patience", "feints", "feint_s", "technique"),
    *("warning", "wait", "aim_noise"),
)


@dataclass(frozen=True)
class Start:
    """What `reset(options=...)` fixes of an episode; the rest is drawn as without it."""

    technique: int | None = None
    """Index of the technique of every strike."""
    pose: tuple[float, float, float] | None = None
    """Pose of the robot: x [m], y [m], yaw [rad]."""


DRAWN: Final = Start()
"""Nothing is fixed."""


class Chance:
    """The draws of n episodes; the last axis of each array is the episode.

    In each step `channels` numbers of an observation are noisy. Of the strikes that are drawn it keeps the
    first `exchanges`, as many as the task comes to.
    """

    def __init__(
        self,
        n: int,
        channels: int,
        opponent: Opponent | Opponents,
        rules: Rules,
        exchanges: int = EXCHANGES,
    ) -> None:
        self._opponent, self._rules = opponent, rules
        self.exchanges = exchanges
        """Number of strikes that are kept."""
        self.start_pose = np.zeros((3, n))
        """Pose of the robot: x [m], y [m], yaw [rad]."""
        self.start_distance = np.zeros(n)
        """Distance of the opponent from the robot [m]."""
        self.drift = np.zeros(n)
        """Sideways walking speed of the opponent, positive to its left [m/s]."""
        self.waves = _by_row(2, WAVES, 2, n)
        """Angular frequency [rad/s] and phase [rad] of each wave along x and along y."""
        self.patience = _by_row(exchanges, n)
        """How long the robot must offer an opening before the opponent strikes [s]."""
        self.feints = _by_row(exchanges, n).astype(bool)
        """Whether a feint precedes the strike."""
        self.feint_s = _by_row(exchanges, n)
        """How long the sword rises in the feint [s]."""
        self.technique = _by_row(exchanges, n).astype(np.intp)
        """Index of the technique."""
        self.warning = _by_row(exchanges, n)
        """Time from the first visible motion to the hit [s]."""
        self.wait = _by_row(exchanges, n)
        """When the sword starts to rise, as a share of the step in which the opponent decides to strike."""
        self.aim_noise = _by_row(2, exchanges, n)
        """Error of the aim along x and y [m]."""
        self.noise = Noise(n, channels)
        """Standard normal noise of each observation."""

    def draw(
        self, rows: RowArray, rngs: Sequence[np.random.Generator], start: Start = DRAWN
    ) -> list[Opponent]:
        """Draw new episodes in rows (m,) with the generators `rngs` of their environments; return opponents.

        What `start` fixes is drawn nevertheless, so that the generators end in the same state. Opponents are
        drawn last, so that the start and the noise of a seed are the same against any opponent.
        """
        uniform, normal = np.empty((len(rows), _UNIFORM)), np.empty((len(rows), 2 * EXCHANGES))
        seeds = []
        for rng, shares, deviations in zip(rngs, uniform, normal, strict=True):
            rng.random(out=shares)
            rng.standard_normal(out=deviations)
            # What `integers(MOST_SEEDS)` gives, in a tenth of its time.
            seeds.append(MOST_SEEDS * rng.random())
        self.noise.restart(rows, np.array(seeds))
        source = self._opponent
        if isinstance(source, Opponents):
            opponents = [source.draw(rng) for rng in rngs]
        else:
            opponents = [source] * len(rows)

        def of_each(name: str) -> Any:
            if isinstance(source, Opponent):
                return getattr(source, name)
            return np.array([getattr(opponent, name) for opponent in opponents]).T

        # From here on everything is for all rows at once, the last axis.
        shares, rules = uniform.T, self._rules
        spread = np.array([rules.start_offset_m, rules.start_offset_m, rules.start_yaw_rad])
        distance = _between(rules.start_m, shares[3])
        pose = (2.0 * shares[:3] - 1.0) * spread[:, None]
        # The robot starts on its side of the centre.
        pose[0] -= distance / 2
        self.start_distance[rows], self.start_pose[:, rows] = distance, pose
        self.drift[rows] = of_each("drift_m_s") * (2.0 * shares[4] - 1.0)
        wave = shares[_START : _START + 2 * WAVES * _PER_WAVE].reshape(2, WAVES, _PER_WAVE, -1)
        self.waves[..., rows] = _LOWEST_WAVE + _MORE_WAVE * wave
        kept = self.exchanges
        exchange = shares[-EXCHANGES * _PER_EXCHANGE :].reshape(_PER_EXCHANGE, EXCHANGES, -1)[:, :kept]
        self.patience[:, rows] = _between(of_each("patience_s"), exchange[0])
        self.feints[:, rows] = exchange[1] < of_each("feint_probability")
        self.feint_s[:, rows] = _between(of_each("feint_s"), exchange[2])
        self.technique[:, rows] = (exchange[3] * len(opponents[0].techniques)).astype(np.intp)
        self.warning[:, rows] = _between(of_each("warning_s"), exchange[4])
        self.wait[:, rows] = exchange[5]
        self.aim_noise[:, :, rows] = of_each("aim_noise_m") * normal.T.reshape(2, EXCHANGES, -1)[:, :kept]
        if start.pose is not None:
            self.start_pose[:, rows] = np.array(start.pose)[:, None]
        if start.technique is not None:
            self.technique[:, rows] = start.technique
        return opponents

    def take(self, other: Chance, row: int) -> None:
        """Give all rows the episode that another one has in a row, without the noise of its observations."""
        for name in _EPISODE:
            getattr(self, name)[...] = getattr(other, name)[..., row, None]


def _between(ends: tuple[float, float] | FloatArray, share: FloatArray) -> FloatArray:
    low, high = ends
    return low + (high - low) * share


def _by_row(*shape: int) -> FloatArray:
    """Return zeros of a shape whose last axis is the episode, those of one episode together in memory."""
    return np.zeros(shape, order="F")


class Noise:
    """Standard normal numbers of n episodes, `channels` of them in each step; 0 until one has begun."""

    def __init__(self, n: int, channels: int) -> None:
        self._seeds = np.zeros(n, np.uint64)
        self._made = np.zeros((n, _NOISE_STEPS, channels), np.float32)
        self._block = np.full(n, -1)  # which steps are made
        self._math = mathematics(n)
        self._all = slice(None) if n == 1 else np.arange(n)
        self._silent = True  # until an episode has begun

    def restart(self, rows: npt.NDArray[np.intp], seeds: FloatArray) -> None:
        """Begin episodes in some rows (m,), whose noise follows from whole numbers `seeds` from 0 to 2^53."""
        self._seeds[rows], self._block[rows], self._silent = seeds, -1, False

    def at(self, step: Number) -> FloatArray:
        """Return the noise at a step of the episodes, shape (channels, n)."""
        block = step // _NOISE_STEPS
        late = block != self._math.of(self._block)
        if self._math.any(late) and not self._silent:
            rows = np.flatnonzero(late)
            self._make(rows, self._math.array(block)[rows])
        return np.asarray(self._made[self._all, step - _NOISE_STEPS * block].T, float)

    def first(self, rows: npt.NDArray[np.intp]) -> FloatArray:
        """Return the noise at the start of the episodes in some rows (m,), shape (channels, m).

        It is made for that step alone: whoever goes on makes the others with it.
        """
        channels = self._made.shape[2]
        size, angle = _polar(self._seeds[rows], np.arange(channels))
        return np.asarray((size * np.cos(angle)).T, float)

    def _make(self, rows: npt.NDArray[np.intp], blocks: npt.NDArray[np.intp]) -> None:
        """Make the steps of some rows (m,) that are in their `blocks` (m,)."""
        _, steps, channels = self._made.shape
        made = _normal(self._seeds[rows], blocks, steps * channels)
        self._made[rows] = made.reshape(-1, steps, channels)
        self._block[rows] = blocks


def _normal(
    seeds: npt.NDArray[np.uint64], blocks: npt.NDArray[np.intp], count: int
) -> npt.NDArray[np.float32]:
    """Return numbers of blocks of an even `count`, shape (m, count), for seeds and blocks (m,)."""
    half = count // 2
    size, angle = _polar(seeds, (blocks * half)[:, None] + np.arange(half))
    made = np.empty((len(blocks), count), np.float32)
    np.multiply(size, np.cos(angle), out=made[:, :half])
    np.multiply(size, np.sin(angle), out=made[:, half:])
    return made


def _polar(
    seeds: npt.NDArray[np.uint64], numbers: npt.NDArray[np.intp]
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return sizes and angles [rad] of pairs of normal numbers, (m, k), for seeds (m,) and `numbers` (m, k).

    The pair with one of the `numbers`, (k,) if they are the same for all seeds, is size times cos and sin.
    """
    bits = hashed(seeds[:, None], numbers.astype(np.uint64))
    # The upper and the lower half of the bits, each a whole number below 2^32.
    share = (bits >> _HALF).astype(np.float32) + _MIDDLE
    return np.sqrt(_MINUS_TWO * np.log(share * _SHARE)), (bits & _LOWER).astype(np.float32) * _ANGLE
