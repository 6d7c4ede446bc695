import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.kinematics import command_to_wheels
from mecanum_env.simulator import SCRIPTS, BodyCommands, WheelCommands, read_commands
from mecanum_env.simulator.commands import hold, scripted

BODY = "time_s,command_v_rpm,command_theta_deg,command_vc_rpm\n"


def written(tmp_path, text, name="commands.csv"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_a_command_holds_from_its_stamp_until_the_next():
    stamps, values = np.array([0.5, 1.0]), np.array([3.0, 7.0])
    assert hold(stamps, values, [0.0, 0.49, 0.5, 0.99, 1.0, 9.0]).tolist() == [0, 0, 3, 3, 7, 7]
    assert hold(stamps, values, [0.0, 2.0], before=-1.0).tolist() == [-1, 7]
    assert hold(np.empty(0), np.empty(0), [0.0, 2.0], before=4.0).tolist() == [4, 4]


def test_rounding_is_that_of_the_body_commands_before_the_wheels():
    sent = BodyCommands.constant(v_rpm=80.4, theta_deg=29.6, vc_rpm=-10.5)
    # -10.5 goes to the even neighbour; the wheel speeds that follow are not whole.
    np.testing.assert_array_equal(sent.wheels_at(0.0, 1.0), command_to_wheels(80, 30, -10))
    np.testing.assert_array_equal(sent.wheels_at(0.0, 0.0), command_to_wheels(80.4, 29.6, -10.5))


def test_wheel_commands_are_rounded_each():
    sent = WheelCommands(np.array([0.0]), np.array([[10.4, -10.6, 0.5, 1.5]]))
    assert sent.wheels_at(0.0, 1.0).tolist() == [10, -11, 0, 2]
    assert sent.wheels_at(0.0, 0.0).tolist() == [10.4, -10.6, 0.5, 1.5]


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ([(0, 1, 2, 3), (0, 1, 2, 3)], "command 2 comes at 0 s, not after 0 s"),
        ([], "at least one command"),
        ([(0, float("nan"), 0, 0)], "finite"),
    ],
)
def test_impossible_commands_are_refused(rows, said):
    with pytest.raises(InputError, match=said):
        BodyCommands.from_rows(rows)


@pytest.mark.parametrize("name", SCRIPTS)
def test_every_script_ends_standing(name):
    commands, duration = scripted(name)
    assert commands.at(duration).tolist() == [0, 0, 0]
    assert duration > commands.time_s[-1] > 0


def test_an_unknown_script_names_those_there_are():
    with pytest.raises(InputError, match=r"no drive called 'turn'.*rotate"):
        scripted("turn")


def test_body_commands_are_read_from_their_first_stamp_on_and_hold_over_empty_cells(tmp_path):
    path = written(tmp_path, BODY + "100,,0,0\n100.5,80,,5\n101,nan,90,\n")
    commands = read_commands(path)
    assert isinstance(commands, BodyCommands)
    assert commands.time_s.tolist() == [0, 0.5, 1]
    assert commands.at(commands.time_s).tolist() == [[0, 0, 0], [80, 0, 5], [80, 90, 5]]


def test_wheel_commands_are_read_in_the_order_of_the_wheels(tmp_path):
    text = "command_rr_rpm,command_fl_rpm,time_s,command_fr_rpm,command_rl_rpm\n4,1,0,2,3\n"
    commands = read_commands(written(tmp_path, text))
    assert isinstance(commands, WheelCommands)
    assert commands.wheels_rpm.tolist() == [[1, 2, 3, 4]]


def test_a_log_can_be_driven_again(tmp_path):
    header = BODY.strip() + ",speed_fl_rpm,vx_m_s,yaw_rad,battery_v\n"
    commands = read_commands(written(tmp_path, header + "0,80,0,0,1.5,,0.1,12\n"))
    assert commands.at(0.0).tolist() == [80, 0, 0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BODY + "0,80,zero,0\n", "line 2: command_theta_deg = 'zero', must be a number"),
        (BODY + "0,80,0,0\n1,80,0,0\n1,0,0,0\n", "line 4: time_s = 1.0 after 1.0"),
        (BODY + "0,80,0,0\n,80,0,0\n", "line 3: time_s is missing"),
        (BODY + "0,80,0,inf\n", "line 2: command_vc_rpm = inf"),
        (
            BODY.replace("theta_deg", "theta") + "0,1,2,3\n",
            'line 1: unknown column .*mean "command_theta_deg"',
        ),
        ("time_s,command_v_rpm\n0,1\n", "column command_theta_deg, command_vc_rpm is missing"),
        ("command_v_rpm,command_theta_deg,command_vc_rpm\n1,2,3\n", "column time_s is missing"),
        (BODY.strip() + ",command_fl_rpm\n0,1,2,3,4\n", "both command sets"),
        ("time_s\n0\n", "no command column"),
        (BODY, "has a header but no rows"),
        ("", "is empty"),
    ],
)
def test_a_bad_file_is_refused_with_its_place(tmp_path, text, said):
    with pytest.raises(InputError, match=f"commands.csv.*{said}"):
        read_commands(written(tmp_path, text))


def test_what_is_no_table_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_commands(tmp_path / "none.csv")
    with pytest.raises(InputError, match=r"a\.txt: not a table of commands.*\.csv"):
        read_commands(written(tmp_path, BODY, "a.txt"))
