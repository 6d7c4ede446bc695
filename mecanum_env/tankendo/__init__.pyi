from .actions import ACTION_MODES, action_to_command, command_to_action
from .constants import DIFFICULTIES, Opponent, Rules, Sensors, Technique, opponent_for
from .observation import Observed, read_observation

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
