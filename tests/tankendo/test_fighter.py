"""What the opponent does: comes to maai, strikes at an opening, sees late, leads its aim."""

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.tankendo import Opponent, Rules, command_to_action
from mecanum_env.tankendo.constants import TECHNIQUES

STAND = (0, 0, 0)
PEACEFUL = Opponent(patience_s=(99.0, 99.0), drift_m_s=0.0)
EAGER = Opponent(patience_s=(0.3, 0.3), feint_probability=0.0, drift_m_s=0.0)
STRAIGHT = Rules(start_yaw_rad=0.0, start_offset_m=0.0)


def run(arena, command, steps):
    """Step an arena with one command; return the last step."""
    actions = np.tile(command_to_action(command), (arena.n, 1))
    for _ in range(steps):
        step = arena.step(actions)
    return step


def strikes(arena, command, steps=40):
    """Return whether a sword ever rises in reply to one command."""
    actions = np.tile(command_to_action(command), (arena.n, 1))
    for _ in range(steps):
        arena.step(actions)
        if np.any(arena.fighter.sword.raise_s > 0.0):
            return True
    return False


def test_it_comes_to_maai(begin):
    step = run(begin(8, opponent=PEACEFUL), STAND, 40)
    np.testing.assert_allclose(step.info["distance_m"], Rules().maai_m, atol=0.05)


def test_it_strikes_at_a_robot_that_is_open(begin):
    assert strikes(begin(opponent=EAGER, rules=STRAIGHT), STAND)


@pytest.mark.parametrize(
    ("what", "command", "opponent", "rules"),
    [
        ("turned away", STAND, EAGER, replace(STRAIGHT, start_yaw_rad=0.3, facing_rad=1e-3)),
        ("out of the band", STAND, replace(EAGER, walk_m_s=0.0), STRAIGHT),
        ("too fast", (60, 180, 0), EAGER, replace(STRAIGHT, field_m=99.0)),
    ],
)
def test_it_does_not_strike_at_one_that_is_not(begin, what, command, opponent, rules):
    assert not strikes(begin(opponent=opponent, rules=rules), command), what


def test_it_waits_for_its_patience(begin):
    arena = begin(opponent=replace(EAGER, patience_s=(1.0, 1.0)), rules=STRAIGHT)
    run(arena, STAND, 60)
    opened = replace(EAGER, patience_s=(0.0, 0.0))
    at_once = begin(opponent=opened, rules=STRAIGHT)
    run(at_once, STAND, 60)
    waited = arena.fighter.sword.raise_s - at_once.fighter.sword.raise_s
    assert 0.8 < waited[0] < 1.2


@pytest.mark.parametrize(
    ("form", "lead", "habit", "expected_m_s"),
    [
        ("none", 1.0, 0.5, (0.0, 0.0)),
        ("constant_velocity", 0.0, 0.5, (0.0, 0.0)),
        ("constant_velocity", 1.0, 0.5, (-0.5, 0.4)),
        ("adaptive", 1.0, 1.0, (-0.5, 0.4)),
        ("adaptive", 1.0, 0.25, (-0.5, 0.4 - 0.75 * 0.2)),
    ],
)
def test_it_aims_at_where_the_robot_will_be_by_what_it_saw(begin, form, lead, habit, expected_m_s):
    """The robot waited at 0.2 m/s to its left and was seen last at (-0.5, 0.4) m/s."""
    far = tuple(replace(technique, reach_m=9.0) for technique in TECHNIQUES)
    opponent = replace(EAGER, lead_form=form, lead=lead, habit=habit, aim_noise_m=0.0, techniques=far)
    arena = begin(opponent=opponent, rules=STRAIGHT)
    while not arena.fighter.aimed[0]:
        run(arena, STAND, 1)
    sword, seen = arena.fighter.sword, np.zeros((6, 1))
    seen[:, 0] = (-1.3, 0.2, 0.0, -0.5, 0.4, 0.0)
    arena.fighter.waiting[:, 0] = (0.0, 0.2)
    technique = TECHNIQUES[int(arena.fighter.technique()[0])]
    ahead = float(sword.land_s[0] - sword.cut_s[0]) + opponent.sight_delay_s
    aim = arena.fighter.aim_at(np.array([0]), seen)[:, 0]
    vx, vy = expected_m_s
    expected = (-1.3 + technique.target_m + vx * ahead, 0.2 + vy * ahead)
    np.testing.assert_allclose(aim, expected, atol=1e-12)


def test_it_reaches_no_farther_than_its_reach(begin):
    arena = begin(opponent=EAGER, rules=STRAIGHT)
    while not arena.fighter.aimed[0]:
        run(arena, STAND, 1)
    far = np.zeros((6, 1))
    far[0] = -3.0
    end = arena.fighter.aim_at(np.array([0]), far)[:, 0]
    technique = TECHNIQUES[int(arena.fighter.technique()[0])]
    assert np.linalg.norm(end - arena.fighter.sword.origin[:, 0]) == pytest.approx(technique.reach_m)


def test_it_knows_the_robot_as_it_was(begin):
    """It aims at the robot as it was one sight delay before the sword starts forward."""
    opponent = replace(EAGER, lead=0.0, aim_noise_m=0.0, techniques=(replace(TECHNIQUES[0], reach_m=9.0),))
    arena = begin(opponent=opponent, rules=STRAIGHT)
    places, times = [], []
    while not arena.fighter.aimed[0]:
        # Back off once the sword rises, so that late and now differ.
        rises = arena.fighter.sword.raise_s[0] > 0.0
        run(arena, (100, 180, 0) if rises else STAND, 1)
        places.append(arena.scenes.now[0, 0])
        times.append(arena.time_s()[0])
    seen_s = arena.fighter.sword.cut_s[0] - opponent.sight_delay_s
    seen = np.interp(seen_s, times, places) + TECHNIQUES[0].target_m
    assert arena.fighter.sword.end[0, 0] == pytest.approx(seen, abs=1e-6)
    assert seen - (places[-1] + TECHNIQUES[0].target_m) > 0.02


def test_a_feint_comes_before_the_strike(begin):
    arena = begin(4, opponent=replace(EAGER, feint_probability=1.0), rules=STRAIGHT)
    was_feint, struck = np.zeros(4, bool), np.zeros(4, bool)
    actions = np.tile(command_to_action(STAND), (4, 1))
    for _ in range(60):
        step = arena.step(actions)
        rising = arena.fighter.sword.raise_s > 0.0
        was_feint |= rising & arena.fighter.sword.is_feint & ~struck
        struck |= step.info["hit"]
        assert not np.any(struck & ~was_feint)
    assert struck.all()


def test_each_technique_is_seen_as_often(begin):
    drawn = begin(200).chance.technique[0]
    counts = np.bincount(drawn, minlength=4)
    assert counts.sum() == 200
    assert counts.min() > 30


def test_it_remembers_how_the_robot_moved_when_the_sword_rose(begin):
    """A robot that creeps sideways at 0.2 m/s is open; its velocity at that time is kept for the aim."""
    arena = begin(opponent=EAGER, rules=STRAIGHT)
    while not arena.fighter.aimed[0]:
        run(arena, (25, 90, 0), 1)
    vx, vy = arena.fighter.waiting[:, 0]
    assert abs(vx) < 0.05
    assert vy == pytest.approx(0.2, abs=0.03)
