"""Controllers by name: their commands, their rules, and what is said of a name that is wrong."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.errors import InputError
from mecanum_env.kinematics import command_to_wheels
from mecanum_env.model import paper_model
from mecanum_env.tankendo import Rules
from mecanum_env.tankendo.actions import FULL_V_RPM, FULL_VC_RPM
from mecanum_env.tankendo.constants import GUARD_TIP_M
from mecanum_env.tankendo.observation import LIMITS
from mecanum_env.tankendo.sword import GUARD_HEIGHT_M
from mecanum_env.tankendo.vector import TankendoVectorEnv
from training.controllers.features import features
from training.controllers.interface import twist_command
from training.controllers.mpc import Planning
from training.controllers.named import CONTROLLERS, SUFFIX, make_controller
from training.controllers.policy import bundled, policy_names, policy_path

# The oracle needs a simulator; trained policies have tests of their own.
EVERYWHERE = [name for name in CONTROLLERS if name not in ("oracle", "policy")]


@pytest.mark.parametrize("suffix", ["", SUFFIX])
@pytest.mark.parametrize("name", EVERYWHERE)
def test_whatever_is_seen_commands_are_whole_and_within_range(name, suffix):
    model = paper_model().with_effect("speed_gain", gain=0.8).with_effect("command_latency", delay_s=0.03)
    controller = make_controller(name + suffix, model)
    rng = np.random.default_rng(0)
    for scale in (0.1, 0.3, 1.0):
        controller.reset()
        for _ in range(12):
            observation = (scale * rng.uniform(-LIMITS, LIMITS)).astype(np.float32)
            v, theta, vc = controller.act(observation)
            assert all(isinstance(number, int) for number in (v, theta, vc))
            assert abs(v) <= FULL_V_RPM
            assert abs(theta) <= 180
            assert abs(vc) <= FULL_VC_RPM


@pytest.mark.parametrize("name", ["random", "p", "smith", "lqr", "mpc", "sidestep", "creep", "retreat"])
def test_reset_forgets(name):
    """The same observations after a reset give the same commands, except from a random generator."""
    controller = make_controller(name, paper_model(), seed=3)
    env = TankendoVectorEnv(1, action_mode="command")
    observation, _ = env.reset(seed=100_000)
    seen = [env.step(np.zeros((1, 3)))[0][0] for _ in range(25)]
    first = [controller.act(one) for one in seen]
    controller.reset()
    again = [controller.act(one) for one in seen]
    assert (first == again) == (name != "random")
    assert observation.shape == (1, 20)


def opponent_ahead(distance_m):
    """Return the observation of an opponent on guard at a distance, in front of a robot at rest."""
    observation = np.zeros(20, np.float32)
    observation[[0, 4, 6, 18]] = distance_m, distance_m - GUARD_TIP_M, GUARD_HEIGHT_M, 1.0
    return observation


@pytest.mark.parametrize("name", ["p", "smith", "lqr", "retreat", "sidestep", "mpc", "p" + SUFFIX])
@pytest.mark.parametrize("maai_m", [1.3, Rules.maai_m, 2.0])
def test_a_controller_keeps_the_distance_of_the_rules(name, maai_m):
    rules, margin_m = Rules(maai_m=maai_m), Planning.wait_margin_m if name == "mpc" else 0.0
    env = TankendoVectorEnv(1, rules=rules, action_mode="command")
    env.reset(seed=100_000)
    seen = opponent_ahead(maai_m + margin_m)
    for controller in (
        make_controller(name, paper_model(), arena=env.arena),
        make_controller(name, paper_model(), rules=rules),
    ):
        v, theta, vc = controller.act(seen)
        # Along the line to the opponent; `mpc` waits in motion across it.
        assert (round(v * np.cos(np.deg2rad(theta))), vc) == (0, 0)
        assert v == 0 or name == "mpc"


def test_a_policy_sees_the_distance_from_the_maai_of_the_rules():
    near = make_controller("policy", paper_model(), rules=Rules(maai_m=1.3))
    usual = make_controller("policy", paper_model())
    seen = opponent_ahead(1.3)
    assert features(seen, 1.3)[0] == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_array_equal(features(seen, 1.3)[1:], features(seen)[1:])
    assert near.act(seen) != usual.act(seen)


@pytest.mark.parametrize("name", policy_names())
def test_a_bundled_policy_is_a_controller_by_its_name(name):
    seen = opponent_ahead(2.0)
    by_path = make_controller(str(bundled(name)), paper_model())
    assert make_controller(name, paper_model()).act(seen) == by_path.act(seen)


def test_the_policy_is_a_bundled_one():
    assert policy_path("policy") == bundled() == policy_path("predicting")
    assert policy_path("mpc") is None


def test_the_oracle_needs_a_simulator():
    with pytest.raises(InputError, match="arena"):
        make_controller("oracle", paper_model())


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(InputError, match=r'did you mean "retreat".*random, still, p, smith, lqr'):
        make_controller("retret", paper_model())


def test_an_unknown_name_is_refused_behind_the_suffix_too():
    with pytest.raises(InputError, match="no such name"):
        make_controller("nothing" + SUFFIX, paper_model())


@pytest.mark.parametrize("name", [SUFFIX, "still" + 2 * SUFFIX])
def test_the_suffix_follows_one_name_once(name):
    with pytest.raises(InputError, match=r"must be one name or path, followed by .compensated once"):
        make_controller(name, paper_model())


def test_no_name_at_all_is_not_the_current_folder():
    with pytest.raises(InputError, match="controller '': no such name"):
        make_controller("", paper_model())


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-10, 10))
def test_saturation_keeps_the_direction_of_the_twist(vx, vy, turn):
    """No wheel is asked for more than its maximum speed; the command is the wanted twist times a factor."""
    robot = paper_model().robot
    v, theta, vc = twist_command(vx, vy, turn, robot)
    wheels = command_to_wheels(v, theta, vc)
    assert np.max(np.abs(wheels)) <= 135 + 3  # rounding of V, theta and VC
    assert abs(vc) <= FULL_VC_RPM
    wanted = np.array([vx, vy, turn * (robot.half_wheelbase_m + robot.half_track_m)])
    asked = np.array([v * np.cos(np.deg2rad(theta)), v * np.sin(np.deg2rad(theta)), vc])
    size = np.linalg.norm(wanted)
    if size > 1.0:
        along = asked @ wanted / size
        assert np.linalg.norm(asked - along * wanted / size) <= 3.0
        assert along > 0.0


@pytest.mark.parametrize("name", ["p", "smith", "lqr", "mpc", "sidestep", "creep", "retreat"])
def test_the_maximum_wheel_speed_is_that_of_the_model(name):
    model = paper_model()
    model = replace(model, wheel=replace(model.wheel, saturation_rpm=60.0))
    controller = make_controller(name, model)
    rng = np.random.default_rng(0)
    for _ in range(20):
        command = controller.act(rng.uniform(-LIMITS, LIMITS).astype(np.float32))
        assert np.max(np.abs(command_to_wheels(*command))) <= 60 + 3  # rounding of V, theta and VC


def test_the_creep_waits_in_motion_and_reverses_when_the_sword_rises():
    controller = make_controller("creep", paper_model())
    waiting = opponent_ahead(Rules.maai_m)
    v, theta, _ = controller.act(waiting)
    assert (v, theta) == (pytest.approx(25, abs=3), 90)
    rising = waiting.copy()
    rising[6] += 0.1
    v, theta, _ = controller.act(rising)
    assert v > 100
    assert theta == -90
