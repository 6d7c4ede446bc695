"""Invalid constants and arguments are refused in one sentence."""

from math import inf, nan

import pytest

from mecanum_env.errors import InputError
from mecanum_env.tankendo import Opponent, Rules, Sensors
from mecanum_env.tankendo.constants import TECHNIQUES, RewardWeights, Technique


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        (Opponent, {"lead": nan}, "Opponent.lead = nan, must be a finite number"),
        (
            Opponent,
            {"sight_delay_s": -0.1},
            "Opponent.sight_delay_s = -0.1, must be a finite number, at least 0",
        ),
        (Opponent, {"feint_probability": 2}, "Opponent.feint_probability = 2, must be a number 0 .. 1"),
        (Opponent, {"patience_s": (1.2, 0.3)}, "must have the lower number first"),
        (Opponent, {"patience_s": 1.0}, "Opponent.patience_s = 1.0, must be two numbers: low, high"),
        (Opponent, {"patience_s": (0.3, inf)}, r"Opponent.patience_s\[1\] = inf"),
        (Opponent, {"techniques": ()}, "must be at least one Technique"),
        (Opponent, {"techniques": ("men",)}, "must be at least one Technique"),
        (Technique, {"name": "men", "swing_s": -0.1}, "Technique.swing_s = -0.1"),
        (Rules, {"band_m": 0}, "Rules.band_m = 0, must be a finite number above 0"),
        (Rules, {"maai_m": "far"}, "Rules.maai_m = 'far', must be a finite number above 0"),
        (Rules, {"duel_points": 1.5}, "Rules.duel_points = 1.5, must be a whole number"),
        (Rules, {"track_share": 80}, "Rules.track_share = 80, must be a number 0 .. 1"),
        (Sensors, {"position_m": -1}, "Sensors.position_m = -1"),
        (RewardWeights, {"hit": inf}, "RewardWeights.hit = inf, must be a finite number"),
    ],
)
def test_constants_that_make_no_sense(kind, values, message):
    rest = {} if kind is not Technique else dict.fromkeys(vars(TECHNIQUES[0]), 1.0)
    with pytest.raises(InputError, match=message):
        kind(**{**rest, **values})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"opponent": "easy"}, "opponent = 'easy', must be a mecanum_env.tankendo.Opponent"),
        ({"opponent": Opponent}, "must be a mecanum_env.tankendo.Opponent"),
        ({"rules": {"band_m": 0.2}}, "must be a mecanum_env.tankendo.Rules"),
        ({"sensors": 1}, "must be a mecanum_env.tankendo.Sensors"),
        ({"model": 3}, "model = 3, must be a model file's path or a mecanum_env.model.Model"),
        ({"plant": None}, "plant = None, must be planar, rollers"),
        ({"difficulty": None}, "difficulty = None, must be easy, normal, hard"),
        ({"action_mode": 1}, "action_mode = 1, must be cartesian"),
        ({"observation_delay": "x"}, "observation_delay = 'x', must be seconds from 0 to 1"),
        ({"observation_delay": nan}, "observation_delay = nan, must be seconds from 0 to 1"),
        ({"timestep_s": "x"}, "timestep_s = 'x', must be a finite number above 0"),
        ({"reward_weights": 5}, "reward_weights = 5, must be terms by name"),
        ({"reward_weights": {"hit": "x"}}, "reward_weights: hit = 'x', must be a finite number"),
        (
            {"rules": Rules(dodge_time_s=0.01)},
            "dodge_time_s = 0.01, must be at least one command period, 0.1 s",
        ),
    ],
)
def test_arguments_of_the_wrong_kind(make, arguments, message):
    with pytest.raises(InputError, match=message):
        make(**arguments)
