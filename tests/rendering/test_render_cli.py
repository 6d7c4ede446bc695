import os
import subprocess
import sys

import imageio.v3 as iio
import numpy as np
import pytest

from mecanum_env import render as program
from mecanum_env.cli import run


def call(*arguments, **environment):
    """Run the program in a process of its own, under OSMesa, and return what it did."""
    forgotten = ("DISPLAY", "WAYLAND_DISPLAY", "PYOPENGL_PLATFORM")
    kept = {k: v for k, v in os.environ.items() if k not in forgotten}
    return subprocess.run(
        [sys.executable, "-m", "mecanum_env.render", *map(str, arguments)],
        env={**kept, "MUJOCO_GL": "osmesa", **environment},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture(scope="module")
def drawn(osmesa, tmp_path_factory):  # noqa: ARG001
    """Draw one short drive as video and still, seen by a camera that stands still."""
    folder = tmp_path_factory.mktemp("drawn")
    video, still = folder / "deep" / "rollout.mp4", folder / "still.png"
    done = call(
        *("paper", "--commands", "forward", "--duration", 1.5, "--camera", "overview", "--fps", 8),
        *("--width", 320, "--height", 240, "--no-caption"),
        *("--out", video, "--still", still, "--still-time", 1.0),
    )
    assert done.returncode == 0, done.stderr
    return done, video, still


@pytest.fixture(scope="module")
def frames(drawn, read_video):
    return read_video(drawn[1])[0]


def test_the_video_has_its_frames_and_size_and_is_not_black(drawn, frames, read_video):
    assert frames.shape == (13, 240, 320, 3)
    assert read_video(drawn[1])[1] == 8
    assert all(frame.mean() > 40 and frame.std() > 10 for frame in frames)


def test_the_robot_moves_in_the_video(frames):
    frames = frames.astype(float)
    # Nothing but the robot moves before a camera that stands still: what changes is where it was and is.
    changed = np.max(np.abs(frames[-1] - frames[0]), axis=2) > 40
    assert 20 < changed.sum() < 0.05 * changed.size
    still = np.max(np.abs(frames[1] - frames[0]), axis=2) > 40
    assert changed.sum() > 3 * still.sum()
    # The camera looks along +y from outside: driving forward (+x) goes right in the picture.
    dark = [np.average(np.nonzero(frame.max(axis=2) < 90)[1]) for frame in (frames[0], frames[-1])]
    assert dark[1] > dark[0] + 10


def test_the_still_is_a_picture_of_the_moment(drawn, frames):
    still = iio.imread(drawn[2]).astype(float)
    assert still.shape == (240, 320, 3)
    differences = np.mean(np.abs(frames - still), axis=(1, 2, 3))
    assert int(np.argmin(differences)) == 8  # 1.0 s at 8 frames a second


def test_the_program_says_what_it_wrote_and_with_what(drawn):
    done, video, still = drawn
    assert f"{video}: 13 frames, 1.5 s, 320 x 240, drawn with osmesa" in done.stdout
    assert f"{still}: 320 x 240 at 1.00 s" in done.stdout


def test_the_backend_is_chosen_before_mujoco_is_imported():
    code = "import sys, mecanum_env.render; sys.exit('mujoco' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_help_names_every_drive():
    from mecanum_env.simulator import SCRIPTS

    assert [name for name in SCRIPTS if name not in program.render.__doc__] == []


@pytest.mark.usefixtures("drawing")
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--commands", "foward"], "no drive called 'foward' (did you mean \"forward\"?)"),
        (["--commands", "missing.csv"], "missing.csv: no such file"),
        (["--out", "a.gif"], "a.gif: its name must end in .mp4"),
        (["--still", "a.mp4"], "a.mp4: its name must end in .png"),
        (["--still", "a.png", "--still-time", "99"], "still_time = 99.0, must be within the drive"),
        (["--duration", "0"], "duration_s = 0.0"),
        (["--width", "641", "--duration", "0.1"], "even sizes: 642 x 480"),
        (["--fps", "0", "--duration", "0.1"], "fps = 0.0"),
        (["--camera", "tap", "--duration", "0.1"], 'did you mean "top"'),
        (["nowhere.json"], "nowhere.json: cannot be read"),
    ],
)
def test_bad_input_is_one_sentence_and_writes_nothing(arguments, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(program.render, arguments) == 2
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
