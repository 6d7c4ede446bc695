"""Distributions of opponents: drawn at reset, seeded, refused where they make no sense, kept in files."""

import json
import pickle
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.senses import VariedSenses
from mecanum_env.tankendo import Opponent, Opponents, opponent_from_dict, opponent_to_dict
from mecanum_env.tankendo.constants import LEAD_FORMS
from mecanum_env.tankendo.opponents import PARAMETERS

RANGES = {"sight_delay_s": (0.15, 0.3), "patience_s": (0.2, 1.6), "lead_form": LEAD_FORMS}


def drawn(env, seeds):
    """Return the opponents of the episodes with these seeds."""
    found = []
    for seed in seeds:
        env.reset(seed=seed)
        found.append(env.unwrapped.arena.fighter.opponents[0])
    return found


@pytest.mark.parametrize("form", [RANGES, Opponents(Opponent(), RANGES)])
def test_an_opponent_is_drawn_for_each_episode_from_its_seed(form):
    env = gymnasium.make("MecanumTankendo-v0", opponent=form)
    first, again = drawn(env, range(12)), drawn(env, range(12))
    assert first == again
    assert {one.lead_form for one in first} == set(LEAD_FORMS)
    assert all(0.15 <= one.sight_delay_s <= 0.3 for one in first)
    assert all(0.2 <= one.patience_s[0] <= one.patience_s[1] <= 1.6 for one in first)
    assert {one.aim_noise_m for one in first} == {Opponent().aim_noise_m}


def test_what_is_drawn_without_checks_passes_them_and_is_the_same():
    ranges = {one.name: one.ends for one in PARAMETERS}
    opponents, rng = Opponents(Opponent(), ranges), np.random.default_rng(5)
    for _ in range(50):
        one = opponents.draw(rng)
        checked = replace(one, techniques=tuple(replace(each) for each in one.techniques))
        assert checked == one
        assert hash(checked) == hash(one)
        assert one != opponents.base


def test_start_and_noise_of_a_seed_do_not_depend_on_the_opponents(make):
    fixed, varied = make(), make(opponent=RANGES)
    np.testing.assert_array_equal(fixed.reset(seed=3)[0], varied.reset(seed=3)[0])


def test_an_episode_against_a_distribution_is_that_against_the_opponent_it_drew(make):
    varied = make(opponent=Opponents(), action_mode="command")
    varied.reset(seed=5)
    fixed = make(opponent=varied.arena.fighter.opponents[0], action_mode="command")
    fixed.reset(seed=5)
    for _ in range(40):
        one, other = varied.step(np.zeros(3, np.float32)), fixed.step(np.zeros(3, np.float32))
        np.testing.assert_array_equal(one[0], other[0])
        assert one[1:4] == other[1:4]
        if one[2]:
            break


@pytest.mark.parametrize("parameter", PARAMETERS, ids=lambda one: one.name)
def test_every_parameter_has_a_range_that_can_be_drawn_and_a_source(parameter):
    rng, opponents = np.random.default_rng(0), Opponents(Opponent(), {parameter.name: parameter.ends})
    assert {opponents.draw(rng) for _ in range(5)} != {Opponent()}
    assert set(parameter.source.split(", ")) <= {"kendo", "reaction", "lunge", "interception", "assumed"}


@pytest.mark.parametrize("opponent", [Opponent(lead=0.5), Opponents(), Opponents(Opponent(), RANGES)])
def test_opponents_go_through_json(opponent):
    assert opponent_from_dict(json.loads(json.dumps(opponent_to_dict(opponent)))) == opponent


@pytest.mark.parametrize(
    ("ranges", "message"),
    [
        ({"sight_delay": (0.1, 0.2)}, 'did you mean "sight_delay_s"'),
        ({"lead": (1.0, 0.5)}, "must be two numbers, the lower first"),
        ({"lead": 1.0}, "must be two numbers or names of forms"),
        ({"sight_delay_s": (-0.1, 0.2)}, "Opponent.sight_delay_s = -0.1"),
        ({"lead_form": ("sudden",)}, "Opponent.lead_form"),
    ],
)
def test_ranges_that_make_no_sense_are_refused(ranges, message):
    with pytest.raises(InputError, match=message):
        gymnasium.make("MecanumTankendo-v0", opponent=ranges)


def test_distributions_can_be_sent_to_other_processes():
    for one in (Opponents(), VariedSenses()):
        assert pickle.loads(pickle.dumps(one)) == one


def test_an_unknown_name_in_a_file_is_refused():
    with pytest.raises(InputError, match='did you mean "habit"'):
        opponent_from_dict({"habits": 1.0})
