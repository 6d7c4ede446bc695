"""The estimator against made-up motions: no simulator is needed, and none is imported."""

import subprocess
import sys

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.senses import CameraFrame, Estimator, OwnReading, Senses, VariedSenses

FRAME_S, STEP_S = 1 / 30, 0.1
NOWHERE = np.full(3, np.nan)


def own(time_s, pose, velocity):
    """Return one robot's reading of itself; the velocity is along its own axes."""
    return OwnReading(np.array([time_s]), np.array(velocity, float)[:, None], np.array(pose, float)[:, None])


def frame(time_s, pose, body, tip):
    """Return what a robot at a pose sees of a body and a tip that are given in the field."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    turn = np.array([[cos, sin], [-sin, cos]])
    seen = turn @ (np.array(body[:2]) - pose[:2])
    tip_seen = [*(turn @ (np.array(tip[:2]) - pose[:2])), tip[2]]
    return CameraFrame(np.array([time_s]), seen[:, None], np.array(tip_seen)[:, None])


def walked(pose, velocity, body, body_velocity, steps=20, noise=0.0, lost=(), age_s=0.0, seed=0):
    """Return the last estimate of a robot and an opponent that both move steadily in the field."""
    rng, estimator = np.random.default_rng(seed), Estimator(1, Senses(), age_s)
    pose, velocity, body, body_velocity = map(np.array, (pose, velocity, body, body_velocity))
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    ahead = [cos * velocity[0] + sin * velocity[1], cos * velocity[1] - sin * velocity[0], 0.0]
    count = 0
    for step in range(steps):
        now, frames = STEP_S * step, []
        for back in (2, 1, 0):
            t = now - 0.05 - back * FRAME_S
            there = body + t * body_velocity + noise * rng.standard_normal(2)
            here = pose + t * np.array([*velocity, 0.0])
            shown = (np.nan, np.nan) if count in lost else there
            frames.append(frame(t, here, shown, (*shown, np.nan if count in lost else 0.6)))
            count += 1
        t = now - 0.05
        found = estimator.update(np.array([now]), own(t, pose + t * np.array([*velocity, 0]), ahead), frames)
    return found, STEP_S * (steps - 1) - age_s


@pytest.mark.parametrize("heading", [0.0, 1.0, 3.1, -2.5])
@pytest.mark.parametrize("age_s", [0.0, 0.05])
def test_steady_motion_is_brought_to_the_asked_time(heading, age_s):
    found, time_s = walked((0, 0, heading), (0.3, -0.1), (2.0, 0.5), (-0.2, 0.4), 30, age_s=age_s)
    cos, sin = np.cos(heading), np.sin(heading)
    turn = np.array([[cos, sin], [-sin, cos]])
    place = turn @ (np.array((2.0, 0.5)) + time_s * np.array((-0.2, 0.4)) - time_s * np.array((0.3, -0.1)))
    np.testing.assert_allclose(found.opponent_m[:, 0], place, atol=0.01)
    np.testing.assert_allclose(found.opponent_m_s[:, 0], turn @ (-0.2, 0.4), atol=0.02)
    np.testing.assert_allclose(found.own_velocity[:2, 0], turn @ (0.3, -0.1), atol=0.01)


def test_noise_is_averaged_out():
    errors = []
    for seed in range(30):
        found, _ = walked((0, 0, 0), (0, 0), (1.7, 0.0), (0, 0), noise=0.01, age_s=0.05, seed=seed)
        errors.append(found.opponent_m[:, 0] - (1.7, 0.0))
    assert np.std(errors) < 0.008


def test_lost_frames_are_bridged_by_the_motion():
    last = 3 * 20
    found, time_s = walked((0, 0, 0), (0, 0), (1.7, 0.0), (0.5, 0.0), lost=range(last - 4, last))
    assert found.opponent_m[0, 0] == pytest.approx(1.7 + 0.5 * time_s, abs=0.03)


def test_a_sudden_motion_is_followed_within_a_tenth_of_a_second():
    """The tip rests for a second, then rises with 1.5 m/s."""
    estimator, pose = Estimator(1, Senses(), 0.05), np.zeros(3)
    for step in range(13):
        now, frames = STEP_S * step, []
        for back in (2, 1, 0):
            t = now - 0.05 - back * FRAME_S
            frames.append(frame(t, pose, (1.7, 0.0), (0.85, 0.0, 0.58 + 1.5 * max(t - 1.05, 0.0))))
        found = estimator.update(np.array([now]), own(now - 0.05, pose, pose), frames)
    assert found.tip_m[2, 0] == pytest.approx(0.58 + 1.5 * 0.1, abs=0.01)
    assert found.tip_m_s[2, 0] == pytest.approx(1.5, abs=0.3)


def test_nothing_of_the_past_is_left_after_a_restart():
    estimator, pose = Estimator(1, Senses(), 0.05), np.zeros(3)

    def first():
        return estimator.update(
            np.zeros(1), own(-0.05, pose, pose), [frame(-0.05, pose, (2.0, 0.1), (1.1, 0.1, 0.6))]
        )

    before = first()
    estimator.update(np.array([0.1]), own(0.05, (1, 1, 1), pose), [])
    estimator.restart(0)
    np.testing.assert_array_equal(first().opponent_m, before.opponent_m)


def test_no_simulator_is_needed():
    program = (
        "import sys, mecanum_env.senses as s; s.Estimator(); "
        "print(*[m for m in sys.modules if m in ('mujoco', 'gymnasium')])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Senses(lost=1.0), r"Senses.lost = 1.0, must be a number 0 .. 0.9"),
        (lambda: Senses(position_m=-1), "Senses.position_m = -1, must be a number from 0"),
        (lambda: Senses(lost_frames=0.5), "must be a number from 1"),
        (lambda: VariedSenses(Senses(), {"los": (0, 0.1)}), 'did you mean "lost"'),
        (lambda: VariedSenses(Senses(), {"lost": (0.2, 0.1)}), "must be two numbers, the lower first"),
        (lambda: VariedSenses(Senses(), {"frame_s": (0.1, 0.2)}), "no number 'frame_s'"),
    ],
)
def test_senses_that_make_no_sense_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()
