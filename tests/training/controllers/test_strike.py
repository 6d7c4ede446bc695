"""The estimate of the strike against the simulator, and the success of evading with it."""

from dataclasses import dataclass

import numpy as np
import pytest

from mecanum_env.tankendo import Opponent, command_to_action, read_observation
from mecanum_env.tankendo.constants import DIFFICULTIES, TECHNIQUES
from mecanum_env.tankendo.fighter import Fighter
from mecanum_env.tankendo.vector import TankendoVectorEnv
from training.controllers import Proportional
from training.controllers.strike import RobotStates, StrikeEstimate, StrikePhase, miss_margin

FIRST_SEED, EPISODES, STEPS = 100_000, 24, 60


@dataclass(frozen=True)
class Moment:
    """What was estimated, and what is true."""

    estimate: StrikeEstimate | None
    idle: bool
    feint: bool
    technique: int
    land_in_s: float
    since_s: float


def watched(difficulty: str) -> list[Moment]:
    """Return every moment of some episodes in which the robot keeps its distance."""
    env = TankendoVectorEnv(EPISODES, difficulty=difficulty, action_mode="command")
    observation, _ = env.reset(seed=FIRST_SEED)
    phases = [StrikePhase() for _ in range(EPISODES)]
    hold, over, moments = Proportional(distance_m=1.8), np.zeros(EPISODES, bool), []
    fighter = env.arena.fighter
    for _ in range(STEPS):
        now = env.arena.time_s()
        for row in np.flatnonzero(~over):
            estimate = phases[row].update(read_observation(observation[row]))
            sword = fighter.sword
            moments.append(
                Moment(
                    estimate,
                    bool(now[row] >= sword.free_s[row]),
                    bool(sword.is_feint[row]),
                    int(fighter.technique()[row]),
                    float(sword.land_s[row] - now[row]),
                    float(now[row] - sword.raise_s[row]),
                )
            )
        commands = [hold.act(one) for one in observation]
        observation, _, terminated, truncated, _ = env.step(command_to_action(commands))
        over |= terminated | truncated
    return moments


@pytest.fixture(scope="module", params=DIFFICULTIES)
def moments(request):
    return watched(request.param)


def test_says_nothing_while_the_sword_is_on_guard(moments):
    calm = [moment for moment in moments if moment.idle and moment.since_s > 2.0]
    assert len(calm) > 100
    assert np.mean([moment.estimate is not None for moment in calm]) < 0.02


def test_knows_technique_and_time_well_before_the_hit(moments):
    """Whatever the level: 0.1 to 0.2 s before the hit, from 3 to 5 observations."""
    strikes = [one for one in moments if not one.idle and not one.feint and 0.1 < one.land_in_s <= 0.2]
    assert len(strikes) >= 15
    assert all(one.estimate is not None for one in strikes)
    likeliest = [np.argmax(np.bincount(one.estimate.technique, one.estimate.weight)) for one in strikes]
    right = [found == one.technique for found, one in zip(likeliest, strikes, strict=True)]
    errors = [one.estimate.land_s - one.land_in_s for one in strikes]
    assert np.mean(right) >= 0.95
    assert np.sqrt(np.mean(np.square(errors))) <= 0.03


def test_tells_feints_from_strikes(moments):
    """Two tenths of a second after the first motion."""
    late = [one for one in moments if not one.idle and 0.2 < one.since_s <= 0.4 and one.estimate is not None]
    assert any(one.feint for one in late)
    wrong = [(one.estimate.strike_probability < 0.5) != one.feint for one in late]
    assert np.mean(wrong) <= 0.05


def test_weights_are_probabilities(moments):
    for one in moments:
        if one.estimate is not None:
            assert np.sum(one.estimate.weight) == pytest.approx(1.0)
            assert np.all(np.diff(one.estimate.weight) <= 1e-12)
            assert np.all(one.estimate.cut_in_s <= one.estimate.land_in_s)


def test_margin_is_negative_exactly_where_the_simulator_hits():
    rng = np.random.default_rng(0)
    n = 2000
    env = TankendoVectorEnv(n)
    env.reset(seed=FIRST_SEED)
    fighter: Fighter = env.arena.fighter
    sword, rows = fighter.sword, np.arange(n)
    env.arena.chance.aim_noise[:] = 0.0
    sword.origin[:] = rng.uniform(-1, 1, (2, n))
    technique = fighter.technique()
    sword.land_s[:], sword.cut_s[:] = 1.0, 1.0 - np.array([t.swing_s for t in TECHNIQUES])[technique]

    def robots():
        scene = np.zeros((6, n))
        angle, distance = rng.uniform(-np.pi, np.pi, n), rng.uniform(1.2, 2.4, n)
        scene[0] = sword.origin[0] + distance * np.cos(angle)
        scene[1] = sword.origin[1] + distance * np.sin(angle)
        scene[2] = rng.uniform(-np.pi, np.pi, n)
        scene[3:5] = 0.5 * rng.standard_normal((2, n))
        return scene

    seen = robots()
    landed = seen.copy()
    landed[:2] += 0.3 * seen[3:5] + 0.12 * rng.standard_normal((2, n))
    fighter.waiting[:] = 0.2 * rng.standard_normal((2, n))
    hits = fighter.hits(rows, landed, fighter.aim_at(rows, seen))
    robots_then = RobotStates(*seen[:5]), RobotStates(*landed[:5])
    margin = miss_margin(Opponent(), technique, sword.origin, *robots_then, fighter.waiting)
    assert 0.2 < np.mean(hits) < 0.8
    np.testing.assert_array_equal(margin <= 0.0, hits)


@pytest.fixture(scope="module")
def shares(successes):
    """Return the share of successes by controller and level."""
    numbers = {"sidestep": 40, "mpc": 20}
    return {
        name: [successes(name, n, difficulty=level) for level in DIFFICULTIES] for name, n in numbers.items()
    }


@pytest.mark.parametrize("name", ["sidestep", "mpc"])
def test_harder_is_harder(shares, name):
    easy, normal, hard = shares[name]
    assert easy >= normal - 0.05
    assert normal >= hard


def test_planning_beats_the_script(shares):
    assert shares["mpc"][1] >= 0.85
    assert shares["mpc"][2] >= shares["sidestep"][2] + 0.15
