"""What is random in an episode, drawn at its start.

`Chance.draw` draws all of it from the environment's own generator, always in the same order. Everything after
that is deterministic, so an episode does not depend on the environments that run beside it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.tankendo.constants import Opponent, Rules
from mecanum_env.tankendo.opponents import Opponents
from mecanum_env.units import FloatArray

EXCHANGES: Final = 16
"""Number of strikes drawn for an episode; a duel with more of them starts over with the first."""
WAVES: Final = 3
"""Number of sine waves, along each axis, that make up the opponent's walk in the tracking task."""

# Counts of the uniform draws: for the start, for each wave (frequency, phase), for each exchange.
_START, _PER_WAVE, _PER_EXCHANGE = 6, 2, 6
_UNIFORM = _START + 2 * WAVES * _PER_WAVE + EXCHANGES * _PER_EXCHANGE
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

    The longest episode has `steps` steps; `channels` numbers of an observation are noisy.
    """

    def __init__(
        self, n: int, steps: int, channels: int, opponent: Opponent | Opponents, rules: Rules
    ) -> None:
        self._opponent, self._rules = opponent, rules
        self.start_pose = np.zeros((3, n))
        """Pose of the robot: x [m], y [m], yaw [rad]."""
        self.start_distance = np.zeros(n)
        """Distance of the opponent from the robot [m]."""
        self.drift = np.zeros(n)
        """Sideways walking speed of the opponent, positive to its left [m/s]."""
        self.waves = np.zeros((2, WAVES, 2, n))
        """Angular frequency [rad/s] and phase [rad] of each wave along x and along y."""
        self.patience = np.zeros((EXCHANGES, n))
        """How long the robot must offer an opening before the opponent strikes [s]."""
        self.feints = np.zeros((EXCHANGES, n), bool)
        """Whether a feint precedes the strike."""
        self.feint_s = np.zeros((EXCHANGES, n))
        """How long the sword rises in the feint [s]."""
        self.technique = np.zeros((EXCHANGES, n), np.intp)
        """Index of the technique."""
        self.warning = np.zeros((EXCHANGES, n))
        """Time from the first visible motion to the hit [s]."""
        self.wait = np.zeros((EXCHANGES, n))
        """When the sword starts to rise, as a share of the step in which the opponent decides to strike."""
        self.aim_noise = np.zeros((2, EXCHANGES, n))
        """Error of the aim along x and y [m]."""
        self.noise = np.zeros((steps + 1, channels, n))
        """Standard normal noise of each observation."""

    def draw(self, row: int, rng: np.random.Generator, start: Start = DRAWN) -> Opponent:
        """Draw a new episode in a row with the generator `rng` of that environment; return its opponent.

        What `start` fixes is drawn nevertheless, so that the generator ends in the same state. The opponent
        is drawn last, so that the start and the noise of a seed are the same against any opponent.
        """
        uniform, normal = rng.random(_UNIFORM), rng.standard_normal(2 * EXCHANGES)
        self.noise[:, :, row] = rng.standard_normal(self.noise.shape[:2])
        rules, opponent = self._rules, self._opponent
        if isinstance(opponent, Opponents):
            opponent = opponent.draw(rng)
        spread = (rules.start_offset_m, rules.start_offset_m, rules.start_yaw_rad)
        self.start_distance[row] = _between(rules.start_m, uniform[3])
        # The robot starts on its side of the centre.
        self.start_pose[:, row] = (2.0 * uniform[:3] - 1.0) * spread
        self.start_pose[0, row] -= self.start_distance[row] / 2
        self.drift[row] = opponent.drift_m_s * (2.0 * uniform[4] - 1.0)
        wave = uniform[_START : _START + 2 * WAVES * _PER_WAVE].reshape(2, WAVES, _PER_WAVE)
        self.waves[:, :, 0, row] = 0.5 + 1.5 * wave[:, :, 0]
        self.waves[:, :, 1, row] = 2.0 * np.pi * wave[:, :, 1]
        exchange = uniform[-EXCHANGES * _PER_EXCHANGE :].reshape(_PER_EXCHANGE, EXCHANGES)
        self.patience[:, row] = _between(opponent.patience_s, exchange[0])
        self.feints[:, row] = exchange[1] < opponent.feint_probability
        self.feint_s[:, row] = _between(opponent.feint_s, exchange[2])
        self.technique[:, row] = (exchange[3] * len(opponent.techniques)).astype(np.intp)
        self.warning[:, row] = _between(opponent.warning_s, exchange[4])
        self.wait[:, row] = exchange[5]
        self.aim_noise[:, :, row] = opponent.aim_noise_m * normal.reshape(2, EXCHANGES)
        if start.pose is not None:
            self.start_pose[:, row] = start.pose
        if start.technique is not None:
            self.technique[:, row] = start.technique
        return opponent

    def take(self, other: Chance, row: int) -> None:
        """Give all rows the episode that another one has in a row, without the noise of its observations."""
        for name in _EPISODE:
            getattr(self, name)[...] = getattr(other, name)[..., row, None]


def _between(ends: tuple[float, float], share: FloatArray) -> FloatArray:
    return ends[0] + (ends[1] - ends[0]) * share
