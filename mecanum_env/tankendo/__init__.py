"""Tankendo as Gymnasium environments: keep the distance, offer an opening, be gone when the strike lands.

    constants    every number of the sport, the opponent, the sensors and the rewards
    checks       of the numbers that a user may put there
    actions      an action of the policy <-> the integers V, theta, VC that the robot takes
    chance       what is drawn at the start of an episode; all that follows is determined
    senses       how an observation is made: late, noisy, with the model's sensor effects
    scene        where robot and opponent are, now and a short while ago
    sword        where the opponent's tip is at a time
    opponent     how it walks, when it strikes, where it aims
    judge        hits, the two rules, rewards, ends: one class a task
    observation  what the robot's sensors tell, number by number
    plant        the physics of many robots at once
    randomize    models drawn from what the identification left open
    arena        all of it together, for any number of rows
    figure       what the opponent looks like; `drawing` puts it into pictures
    env, vector  Gymnasium's interfaces of an arena, with one row and with many

All but `plant` is plain numpy on arrays whose last axis counts the environments, without physics.
"""

import contextlib
from typing import TYPE_CHECKING

from mecanum_env.errors import BackendError
from mecanum_env.lazy import lazy_exports
from mecanum_env.rendering.backend import use_backend

if TYPE_CHECKING:
    from mecanum_env.tankendo.actions import ACTION_MODES, action_to_command, command_to_action
    from mecanum_env.tankendo.constants import DIFFICULTIES, Opponent, Rules, Sensors, Technique, opponent_for
    from mecanum_env.tankendo.observation import Observed, read_observation
else:
    __getattr__, __dir__ = lazy_exports(__name__, __file__)

__all__ = [
    "ACTION_MODES",
    "DIFFICULTIES",
    "Observed",
    "Opponent",
    "Rules",
    "Sensors",
    "Technique",
    "action_to_command",
    "command_to_action",
    "opponent_for",
    "read_observation",
]

# Before anything here imports mujoco, which picks its graphics library then; without one, only drawing fails.
with contextlib.suppress(BackendError):
    use_backend()
