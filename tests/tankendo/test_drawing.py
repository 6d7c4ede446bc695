"""Pictures of an episode."""

import os
import subprocess
import sys
from contextlib import nullcontext
from types import SimpleNamespace

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.utils.passive_env_checker import env_render_passive_checker
from gymnasium.wrappers import RecordVideo

import mecanum_env
from mecanum_env.errors import BackendError
from mecanum_env.mjcf.chassis import SWORD_M
from mecanum_env.tankendo import drawing
from mecanum_env.tankendo import env as tankendo_env
from mecanum_env.tankendo.drawing import opponent_shapes, score_lines

STILL = np.zeros(3, np.float32)


@pytest.mark.parametrize("plant", ["planar", "rollers"])
def test_a_picture_shows_robot_opponent_and_score(make, plant):
    env = make(render_mode="rgb_array", plant=plant)
    env.reset(seed=0)
    env_render_passive_checker(env)
    first = env.render()
    assert first.shape == (480, 640, 3)
    assert first.dtype == np.uint8
    for _ in range(8):
        env.step(STILL)
    later = env.render()
    box = (slice(0, 70), slice(0, 300))
    assert np.mean(np.abs(first[box].astype(float) - later[box])) > 0.5  # the overlay
    assert np.mean(np.any(first[100:] != later[100:], axis=-1)) > 0.02  # the opponent walks
    assert np.mean(later[:80, :300]) < np.mean(later[:80, 500:])  # dark behind the text


@pytest.mark.parametrize(
    "first", ["gymnasium, mecanum_env", "mecanum_env, gymnasium", "mecanum_env.tankendo.env, gymnasium"]
)
def test_the_package_chooses_how_to_draw_without_a_display(first):
    """MuJoCo chooses its graphics library when it is imported, so the package must be first."""
    program = (
        f"import {first}; env = gymnasium.make('MecanumTankendo-v0', render_mode='rgb_array'); "
        "env.reset(seed=0); print(env.render().shape); env.close()"
    )
    unset = ("MUJOCO_GL", "PYOPENGL_PLATFORM", "DISPLAY", "WAYLAND_DISPLAY")
    environment = {name: value for name, value in os.environ.items() if name not in unset}
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=environment)
    assert done.stdout.strip() == "(480, 640, 3)", done.stderr


def test_the_strike_is_seen(make):
    env = make(render_mode="rgb_array")
    env.reset(seed=0)
    lines, orange = [], []
    for _ in range(60):
        _, _, terminated, _, _ = env.step(STILL)
        frame = env.render()[120:].astype(int)
        orange.append(int(np.sum((frame[..., 0] > 200) & (frame[..., 1] < 130) & (frame[..., 2] < 90))))
        lines.append(score_lines(env.arena))
        if terminated:
            break
    assert max(orange) > 4 * np.median(orange) + 20
    assert any("raises its sword" in line for shown in lines for line in shown)
    assert lines[-1][-1] == "HIT"


def test_the_sword_is_as_long_as_the_sport_says(make):
    env = make()
    env.reset(seed=0)
    sword = opponent_shapes(env.arena)[7:11]
    ends = np.array([sword[0].start, sword[-1].end])
    tip = env.arena.tip(0)
    np.testing.assert_allclose(ends[1], tip, atol=1e-9)
    assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(SWORD_M)


def test_gymnasium_records_a_video(tmp_path):
    pytest.importorskip("moviepy")
    env = RecordVideo(
        gymnasium.make("MecanumTankendo-v0", render_mode="rgb_array"),
        str(tmp_path / "video"),
        disable_logger=True,
    )
    env.reset(seed=0)
    for _ in range(5):
        env.step(STILL)
    env.close()
    assert mecanum_env.__version__
    assert [path.suffix for path in (tmp_path / "video").iterdir() if path.suffix == ".mp4"] == [".mp4"]


def test_drawing_changes_nothing(make):
    drawn, plain = make(render_mode="rgb_array"), make()
    for env in (drawn, plain):
        env.reset(seed=2)
    for _ in range(5):
        a = drawn.step(STILL)[0]
        drawn.render()
        np.testing.assert_array_equal(a, plain.step(STILL)[0])


def test_a_window_without_a_display_is_refused(make, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    env = make(render_mode="human")
    with pytest.raises(BackendError, match='use "rgb_array" for pictures, or'):
        env.reset(seed=0)


def test_a_display_that_does_not_answer_is_refused_in_the_same_words(make, monkeypatch):
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", ":4711")
    with pytest.raises(BackendError, match="there is no display here"):
        make(render_mode="human").reset(seed=0)


def test_a_window_shows_the_same_shapes(make, monkeypatch):
    """Without a display: MuJoCo's viewer is replaced by one that keeps what it is given."""
    from mujoco import viewer

    shown = []

    def launch(model, data, **_):
        scene = mujoco.MjvScene(model, 200)
        return SimpleNamespace(
            cam=mujoco.MjvCamera(),
            user_scn=scene,
            lock=nullcontext,
            set_texts=lambda text: shown.append(text[2]),
            sync=lambda: None,
            close=lambda: shown.append("closed"),
        )

    monkeypatch.setattr(tankendo_env, "display_answers", lambda: True)
    monkeypatch.setattr(viewer, "launch_passive", launch)
    monkeypatch.setattr(drawing.time, "sleep", lambda _: None)
    env = make(render_mode="human")
    env.reset(seed=0)
    env.step(STILL)
    window = env._window
    assert window._viewer.user_scn.ngeom == len(opponent_shapes(env.arena))
    assert len(shown) == 2
    assert "opponent on guard" in shown[-1]
    env.close()
    assert shown[-1] == "closed"


def test_render_without_a_mode_warns(make):
    env = make()
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render_mode"):
        assert env.render() is None
