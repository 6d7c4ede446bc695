"""P, Smith predictor, LQR and pose controller: their invariants, and their errors on the simulator."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.errors import InputError
from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.model import Robot, paper_model
from mecanum_env.simulator.robot import RobotSession
from training.controllers import Lqr, PoseController, Proportional, Smith
from training.controllers.lqr import Weights, axis_dynamics, riccati_gain

LAW = paper_model().wheel.law
ZERO = np.zeros(3)
weights = st.builds(Weights, st.floats(0.005, 0.5), st.floats(0.05, 2.0))


def observations(seed, n=20):
    """Return plausible observations: an opponent near maai that moves, a robot that moves."""
    rng = np.random.default_rng(seed)
    seen = np.zeros((n, 20), np.float32)
    seen[:, 0], seen[:, 1] = 1.7 + 0.3 * rng.standard_normal(n), 0.3 * rng.standard_normal(n)
    seen[:, 2:4] = 0.4 * rng.standard_normal((n, 2))
    seen[:, 10:13] = 0.4 * rng.standard_normal((n, 3))
    seen[:, 18] = 1.0
    return seen


@pytest.mark.parametrize("seed", range(3))
def test_without_delays_and_lead_smith_is_p(seed):
    model = paper_model()
    smith = Smith(model, gain_per_s=3.0, turn_gain_per_s=2.5, lead=0.0, horizon_s=0.0)
    p = Proportional(gain_per_s=3.0, turn_gain_per_s=2.5, robot=model.robot)
    for seen in observations(seed):
        assert smith.act(seen) == p.act(seen)


def test_smith_takes_into_account_what_is_under_way():
    """Sent forward at full speed, late by 0.2 s, it sees the gap as already smaller."""
    model = paper_model().with_effect("command_latency", delay_s=0.2)
    smith = Smith(model)
    far = observations(0, 1)[0] * 0
    far[0], far[18] = 1.75, 1.0
    first = smith.act(far)
    assert first[0] > 0
    assert first[1] == 0
    for _ in range(2):
        later = smith.act(far)
    assert later[0] < first[0]


def tracking_gain(law, weight):
    return riccati_gain(*axis_dynamics(law, 0.1), weight)


@given(weights)
def test_the_closed_loop_of_lqr_is_stable(weight):
    f, g = axis_dynamics(LAW, 0.1)
    assert np.max(np.abs(np.linalg.eigvals(f - g @ riccati_gain(f, g, weight)[None]))) < 1.0


@given(weights, st.integers(1, 4), st.integers(0, 1000))
def test_gain_of_late_commands_is_the_gain_on_the_predicted_state(weight, delay, seed):
    """The commands under way, newest first, are the last states of the late robot."""
    f, g = axis_dynamics(LAW, 0.1)
    late_f, late_g = np.zeros((6 + delay, 6 + delay)), np.zeros((6 + delay, 1))
    late_f[:6, :6], late_f[:6, -1:], late_f[7:, 6:-1], late_g[6] = f, g, np.eye(delay - 1), 1.0
    rng = np.random.default_rng(seed)
    state, under_way = rng.standard_normal(6), rng.standard_normal(delay)
    late = riccati_gain(late_f, late_g, weight) @ np.concatenate([state, under_way])
    for command in under_way[::-1]:  # the oldest acts first
        state = f @ state + g[:, 0] * command
    assert late == pytest.approx(tracking_gain(LAW, weight) @ state, rel=1e-5, abs=1e-6)


def test_dynamics_are_those_of_the_law():
    """Twelve ticks of the law with a held command, and the trapezoid of its speeds."""
    f, g = axis_dynamics(LAW, 0.1)
    speeds = LAW.simulate(np.full(12, 7.0))
    after = g[:, 0] * 7.0
    np.testing.assert_allclose(after[:3], speeds[[-1, -2, -3]], atol=1e-12)
    assert after[5] == pytest.approx(np.trapezoid(speeds, dx=LAW.sample_period_s))
    # A steady motion stays one, and goes on evenly: unit DC gain.
    steady = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.0])
    np.testing.assert_allclose(f @ steady + g[:, 0], [1, 1, 1, 1, 1, 0.1], atol=1e-12)


def test_cheaper_commands_make_a_stiffer_loop():
    stiff = tracking_gain(LAW, Weights(0.02, 1.0))[-1]
    soft = tracking_gain(LAW, Weights(0.02, 0.1))[-1]
    assert stiff > 2.0 * soft > 0.0


def test_gains_follow_the_model():
    slow = WheelLaw(0.95, 0.0, 0.0, 0.05, 0.0, 0.0, LAW.sample_period_s)
    weight = Weights(0.03, 0.3)
    assert np.max(np.abs(tracking_gain(slow, weight) - tracking_gain(LAW, weight))) > 0.1


@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan"), float("inf")])
def test_weights_must_be_positive(bad):
    with pytest.raises(InputError, match="place"):
        Weights(bad, 1.0)


def test_lqr_stands_where_it_should_be():
    seen = np.zeros(20, np.float32)
    seen[0], seen[18] = 1.7, 1.0
    assert Lqr(paper_model()).act(seen) == (0, 0, 0)


def test_prediction_and_feed_forward_beat_p_and_lqr_beats_both(tracking_error):
    p, smith, lqr = (tracking_error(name, 6) for name in ("p", "smith", "lqr"))
    assert smith < 0.75 * p
    assert lqr < 0.95 * smith


def test_a_known_latency_costs_little(tracking_error):
    model = paper_model().with_effect("command_latency", delay_s=0.2)
    aware = tracking_error("smith", 4, model)
    blind = tracking_error("smith", 4, model, known=paper_model())
    assert aware < 0.9 * blind


@pytest.fixture
def pose_controller() -> PoseController:
    return PoseController(Robot())


@pytest.mark.parametrize(
    ("wanted", "theta"), [((1, 0, 0), 0), ((0, 1, 0), 90), ((-1, 0, 0), 180), ((0, -1, 0), -90)]
)
def test_pose_control_drives_towards_the_target(pose_controller, wanted, theta):
    v, direction, vc = pose_controller.command(ZERO, np.array(wanted, float), ZERO)
    assert (v > 0, direction, vc) == (True, theta, 0)


def test_pose_control_asks_for_the_direction_in_the_body_frame(pose_controller):
    facing_left = np.array([0.0, 0.0, np.pi / 2])
    _, direction, _ = pose_controller.command(facing_left, np.array([1.0, 0.0, np.pi / 2]), ZERO)
    assert direction == -90


def test_pose_control_turns_the_short_way(pose_controller):
    _, _, vc = pose_controller.command(np.array([0, 0, 3.0]), np.array([0, 0, -3.0]), ZERO)
    assert vc > 0


def test_pose_control_stays_within_the_limit_in_whole_numbers(pose_controller):
    v, theta, vc = pose_controller.command(ZERO, np.array([30.0, -20.0, 2.0]), ZERO)
    assert all(isinstance(x, int) for x in (v, theta, vc))
    assert abs(v) * np.sqrt(2) + abs(vc) <= 135 * np.sqrt(2) + 2


@pytest.mark.parametrize("plant", ["planar", "rollers"])
def test_pose_control_follows_a_circle_within_five_centimetres(pose_controller, plant):
    radius, rate = 0.5, 1.0
    session = RobotSession(paper_model(), plant)
    errors = []
    for k in range(60):
        angle = rate * k * 0.1
        wanted = np.array([radius * np.sin(angle), radius * (1 - np.cos(angle)), angle])
        twist = np.array([radius * rate * np.cos(angle), radius * rate * np.sin(angle), rate])
        errors.append(np.linalg.norm(wanted[:2] - session.pose[:2]))
        session.advance(*pose_controller.command(session.pose, wanted, twist))
    assert max(errors[20:]) < 0.05
    assert session.time_s == pytest.approx(6.0)
