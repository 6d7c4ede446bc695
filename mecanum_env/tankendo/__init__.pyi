from .actions import ACTION_MODES, action_to_command, command_to_action
from .constants import DIFFICULTIES, Opponent, Rules, Sensors, Technique, opponent_for
from .observation import Observed, read_observation
from .opponents import Opponents, opponent_from_dict, opponent_to_dict

__all__ = [
    "ACTION_MODES",
    "DIFFICULTIES",
    "Observed",
    "Opponent",
    "Opponents",
    "Rules",
    "Sensors",
    "Technique",
    "action_to_command",
    "command_to_action",
    "opponent_for",
    "opponent_from_dict",
    "opponent_to_dict",
    "read_observation",
]
