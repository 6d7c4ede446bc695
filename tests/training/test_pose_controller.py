import numpy as np
import pytest

from mecanum_env.model import Robot, paper_model
from mecanum_env.simulator.robot import RobotSession
from training.controllers import PoseController

ZERO = np.zeros(3)


@pytest.fixture
def controller() -> PoseController:
    return PoseController(Robot())


@pytest.mark.parametrize(
    ("wanted", "theta"), [((1, 0, 0), 0), ((0, 1, 0), 90), ((-1, 0, 0), 180), ((0, -1, 0), -90)]
)
def test_drives_towards_the_target(controller, wanted, theta):
    v, direction, vc = controller.command(ZERO, np.array(wanted, float), ZERO)
    assert (v > 0, direction, vc) == (True, theta, 0)


def test_direction_is_that_of_the_body(controller):
    facing_left = np.array([0.0, 0.0, np.pi / 2])
    _, direction, _ = controller.command(facing_left, np.array([1.0, 0.0, np.pi / 2]), ZERO)
    assert direction == -90


def test_turns_the_short_way(controller):
    _, _, vc = controller.command(np.array([0, 0, 3.0]), np.array([0, 0, -3.0]), ZERO)
    assert vc > 0


def test_no_wheel_beyond_the_limit_and_whole_numbers(controller):
    v, theta, vc = controller.command(ZERO, np.array([30.0, -20.0, 2.0]), ZERO)
    assert all(isinstance(x, int) for x in (v, theta, vc))
    assert abs(v) * np.sqrt(2) + abs(vc) <= 135 * np.sqrt(2) + 2


@pytest.mark.parametrize("plant", ["planar", "rollers"])
def test_follows_a_circle_within_five_centimetres(controller, plant):
    radius, rate = 0.5, 1.0
    session = RobotSession(paper_model(), plant)
    errors = []
    for k in range(60):
        angle = rate * k * 0.1
        wanted = np.array([radius * np.sin(angle), radius * (1 - np.cos(angle)), angle])
        twist = np.array([radius * rate * np.cos(angle), radius * rate * np.sin(angle), rate])
        errors.append(np.linalg.norm(wanted[:2] - session.pose[:2]))
        session.advance(*controller.command(session.pose, wanted, twist))
    assert max(errors[20:]) < 0.05
    assert session.time_s == pytest.approx(6.0)
