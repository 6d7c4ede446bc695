"""Actions and commands."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.errors import InputError
from mecanum_env.kinematics import command_to_wheels
from mecanum_env.tankendo import ACTION_MODES, action_to_command, command_to_action
from mecanum_env.tankendo.actions import check_mode, checked_action


@pytest.mark.parametrize(
    ("mode", "action", "command"),
    [
        ("cartesian", (1, 0, 0), (135, 0, 0)),
        ("cartesian", (0, -1, 0.5), (135, -90, 50)),
        ("cartesian", (1, 1, -1), (135, 45, -100)),
        ("cartesian", (-0.2, 0, 0), (27, 180, 0)),
        ("cartesian", (0, 0, 0), (0, 0, 0)),
        ("polar", (-1, 0.5, 0), (0, 90, 0)),
        ("polar", (1, -1, 0), (135, -180, 0)),
        ("command", (-1, 0.5, 1), (-135, 90, 100)),
        ("command", (2, 0, -2), (135, 0, -100)),
    ],
)
def test_what_an_action_asks_for(mode, action, command):
    np.testing.assert_array_equal(action_to_command(action, mode), command)


def test_commands_are_whole_numbers():
    actions = np.random.default_rng(0).uniform(-1, 1, (200, 3))
    for mode in ACTION_MODES:
        commands = action_to_command(actions, mode)
        np.testing.assert_array_equal(commands, np.rint(commands))


def test_a_robot_without_a_quantum_takes_real_numbers():
    command = action_to_command((0.123, 0.0, 0.123), "command", quantum_rpm=0.0)
    np.testing.assert_allclose(command, (135 * 0.123, 0.0, 12.3))


@given(st.integers(-135, 135), st.integers(-180, 180), st.integers(-100, 100))
def test_a_command_survives_as_an_action(v, theta, vc):
    np.testing.assert_array_equal(
        action_to_command(command_to_action((v, theta, vc)), "command"), (v, theta, vc)
    )


@pytest.mark.parametrize("mode", ["cartesian", "polar"])
@given(st.integers(-135, 135), st.integers(-720, 720), st.integers(-100, 100))
def test_other_modes_ask_for_the_same_wheels(mode, v, theta, vc):
    wheels = command_to_wheels(v, theta, vc)
    again = action_to_command(command_to_action((v, theta, vc), mode), mode)
    np.testing.assert_allclose(command_to_wheels(*again), wheels, atol=3.0)


def test_an_unknown_mode_is_refused():
    with pytest.raises(InputError, match='did you mean "polar"'):
        check_mode("polr")


def test_the_actions_of_thousands_of_robots_are_checked_without_blas(monkeypatch):
    # Of more than 10,000 numbers OpenBLAS makes a task for all processors, whose threads then wait busily.
    for name in ("vdot", "dot", "inner"):
        monkeypatch.setattr(np, name, None)
    actions = np.zeros((4096, 3))
    assert checked_action(actions, (4096, 3)) is actions
    actions[17, 2] = np.inf
    with pytest.raises(InputError, match=r"action\[17, 2\] = inf"):
        checked_action(actions, (4096, 3))
