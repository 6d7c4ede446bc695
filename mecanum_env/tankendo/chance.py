"""What is drawn at the start of an episode, for many episodes side by side.

All of an episode's chance is drawn in `Chance.draw`, from the environment's own generator, in one fixed
order. What follows is determined, so it does not matter which other environments run beside it.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mecanum_env.tankendo.constants import Opponent, Rules
from mecanum_env.units import FloatArray

EXCHANGES: Final = 16
"""Strikes of an episode that differ; a duel with more begins again with the first."""
WAVES: Final = 3
"""Sine waves along, and as many across, that the opponent's walk in the tracking task is made of."""

# Even draws in [0, 1): of the start, of the walk, of each exchange.
_START, _PER_EXCHANGE = 6, 6
_PER_WAVE = 2
_UNIFORM = _START + 2 * WAVES * _PER_WAVE + EXCHANGES * _PER_EXCHANGE


class Chance:
    """The draws of n episodes; arrays have the episode on their last axis.

    Args:
        n: number of episodes.
        steps: longest episode in steps.
        channels: noisy numbers of an observation.
        opponent: its ranges count.
        rules: the starting place's ranges count.
    """

    def __init__(self, n: int, steps: int, channels: int, opponent: Opponent, rules: Rules) -> None:
        self._opponent, self._rules = opponent, rules
        self.start_place = np.zeros((3, n))
        """x [m], y [m], yaw [rad] of the robot."""
        self.start_distance = np.zeros(n)
        """Of the opponent from the robot [m]."""
        self.drift = np.zeros(n)
        """Sideways walk of the opponent [m/s], positive to its left."""
        self.waves = np.zeros((2, WAVES, 2, n))
        """Along and across, each wave: angular frequency [rad/s] and phase [rad]."""
        self.patience = np.zeros((EXCHANGES, n))
        """How long the robot must be open before it is struck at [s]."""
        self.feints = np.zeros((EXCHANGES, n), bool)
        """Whether a feint comes before the strike."""
        self.feint_s = np.zeros((EXCHANGES, n))
        """How long the sword rises in the feint [s]."""
        self.technique = np.zeros((EXCHANGES, n), np.intp)
        """Index of the technique."""
        self.warning = np.zeros((EXCHANGES, n))
        """From the first visible motion to the hit [s]."""
        self.wait = np.zeros((EXCHANGES, n))
        """Share of a step by which the strike starts after its beginning."""
        self.aim_noise = np.zeros((2, EXCHANGES, n))
        """Error of the aim along x and y [m]."""
        self.noise = np.zeros((steps + 1, channels, n))
        """Standard normal noise of each observation."""

    def draw(self, row: int, rng: np.random.Generator) -> None:
        """Draw a new episode.

        Args:
            row: which.
            rng: generator of that environment.
        """
        even, normal = rng.random(_UNIFORM), rng.standard_normal(2 * EXCHANGES)
        rules, opponent = self._rules, self._opponent
        offset, yaw = rules.start_offset_m, rules.start_yaw_rad
        self.start_place[:, row] = (2.0 * even[:3] - 1.0) * (offset, offset, yaw)
        self.start_distance[row] = _between(rules.start_m, even[3])
        self.drift[row] = opponent.drift_m_s * (2.0 * even[4] - 1.0)
        wave = even[_START : _START + 2 * WAVES * _PER_WAVE].reshape(2, WAVES, _PER_WAVE)
        self.waves[:, :, 0, row] = 0.5 + 1.5 * wave[:, :, 0]
        self.waves[:, :, 1, row] = 2.0 * np.pi * wave[:, :, 1]
        each = even[-EXCHANGES * _PER_EXCHANGE :].reshape(_PER_EXCHANGE, EXCHANGES)
        self.patience[:, row] = _between(opponent.patience_s, each[0])
        self.feints[:, row] = each[1] < opponent.feint_probability
        self.feint_s[:, row] = _between(opponent.feint_s, each[2])
        self.technique[:, row] = (each[3] * len(opponent.techniques)).astype(np.intp)
        self.warning[:, row] = _between(opponent.warning_s, each[4])
        self.wait[:, row] = each[5]
        self.aim_noise[:, :, row] = opponent.aim_noise_m * normal.reshape(2, EXCHANGES)
        self.noise[:, :, row] = rng.standard_normal(self.noise.shape[:2])


def _between(ends: tuple[float, float], share: FloatArray) -> FloatArray:
    return ends[0] + (ends[1] - ends[0]) * share
