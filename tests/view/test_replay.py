"""A log beside its simulation."""

from pathlib import Path

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.kinematics import POSE, TWIST
from mecanum_env.simulator import BodyCommands, drive
from mecanum_env.view.picture import placed
from mecanum_env.view.replay import read_log, replay

LOGS = Path(__file__).parents[2] / "examples" / "logs"
START = (1.0, -2.0, 0.7)
COMMANDS = ("command_v_rpm", "command_theta_deg", "command_vc_rpm")
CHANNELS = ("speed_fl_rpm", *TWIST, *POSE)


def write(path, columns):
    names = list(columns)
    rows = np.stack([columns[name] for name in names], axis=1)
    np.savetxt(path, rows, delimiter=",", header=",".join(names), comments="", fmt="%.9g")
    return path


@pytest.fixture
def recorded(paper, tmp_path):
    """Return the file of a log of the packaged robot that starts elsewhere, on the planar plant."""
    commands = BodyCommands.from_rows([(0.0, 0, 0, 0), (0.2, 80, 30, 20), (0.9, 0, 0, 0)])
    time = np.arange(0.0, 1.5, 0.01)
    shown = drive(paper, commands, 1.5, plant="planar").channels_at(time)
    cos, sin = np.cos(START[2]), np.sin(START[2])
    x, y = shown["x_m"], shown["y_m"]
    shown["x_m"], shown["y_m"] = START[0] + cos * x - sin * y, START[1] + sin * x + cos * y
    shown["yaw_rad"] = START[2] + shown["yaw_rad"]
    columns = dict(zip(COMMANDS, commands.at(time).T, strict=True))
    return write(
        tmp_path / "log.csv", {"time_s": time, **columns, **{name: shown[name] for name in CHANNELS}}
    )


def test_the_model_that_made_a_log_fits_it(paper, recorded):
    shown = replay(paper, read_log(recorded), "planar")
    assert list(shown.simulated) == list(CHANNELS)
    assert max(shown.rms().values()) < 1e-6


def test_another_model_does_not(paper, recorded):
    other = paper.with_effect("command_latency", delay_s=0.1)
    assert replay(other, read_log(recorded), "planar").rms()["vx_m_s"] > 0.05


def test_the_logged_robot_stands_where_the_simulated_one_does(paper, recorded):
    robot = replay(paper, read_log(recorded), "planar").robot
    last = placed(robot.mj_model, robot.qpos[0], robot.logged_pose[-1])
    np.testing.assert_allclose(last, robot.qpos[-1], atol=0.02)


@pytest.mark.parametrize("plant", ["planar", "rollers"])
def test_a_placed_robot_is_at_its_pose(paper, plant):
    path = drive(paper, BodyCommands.constant(0.0), 0.1, plant=plant)
    import mujoco

    data = mujoco.MjData(path.mj_model)
    data.qpos[:] = placed(path.mj_model, path.qpos[-1], np.array(START))
    mujoco.mj_kinematics(path.mj_model, data)
    x, y, _ = data.body("base").xpos
    forward = data.body("base").xmat.reshape(3, 3)[:, 0]
    np.testing.assert_allclose((x, y, np.arctan2(forward[1], forward[0])), START, atol=1e-3)


def test_without_a_pose_the_velocity_is_summed_up(paper, recorded):
    log = read_log(recorded)
    channels = {name: values for name, values in log.channels.items() if name not in POSE}
    summed = type(log)(log.name, log.time_s, channels, log.commands)
    robot = replay(paper, summed, "planar").robot
    np.testing.assert_allclose(robot.logged_pose[-1, :2], robot.qpos[-1, :2], atol=0.01)


def test_a_command_logged_a_little_late_is_not_replayed_a_period_late(paper, recorded):
    text = np.genfromtxt(recorded, delimiter=",", names=True)
    columns = {name: text[name].copy() for name in text.dtype.names}
    columns["time_s"][1:] += 2e-5
    late = write(recorded, columns)
    assert replay(paper, read_log(late), "planar").rms()["speed_fl_rpm"] < 0.1


def test_a_bench_log_is_replayed_on_the_wheel(paper):
    shown = replay(paper, read_log(LOGS / "step_080_1.csv"))
    assert shown.robot is None
    assert list(shown.simulated) == ["speed_rpm"]
    assert shown.rms()["speed_rpm"] < 3.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "no such file"),
        ("time_s,command_rpm\n0,1\n1,1\n", "nothing measured"),
        ("time_s,speed_fl_rpm\n0,1\n1,1\n", "no command column"),
        ("time_s,command_rpm,speed_rpm\n0,1,1\n", "nothing measured"),
        ("time_s,command_rpm,speed_rpm\n1,1,1\n0,1,1\n", "line 3: time_s = 0, must be larger"),
        ("time_s,command_rpm,speed_rpm\n,1,1\n1,1,1\n", "line 2: time_s"),
        ("command_rpm,speed_rpm\n1,1\n0,1\n", "no column time_s"),
    ],
)
def test_a_file_that_is_no_log_is_refused(paper, tmp_path, text, message):
    path = tmp_path / "log.csv"
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError, match=message):
        replay(paper, read_log(path))
