"""A video of an episode: the one that was evaluated, with its plots."""

import imageio.v3 as iio
import numpy as np
import pytest

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.tankendo.env import TankendoEnv
from training.controllers.scripted import Still
from training.evaluate import Setup, controller_factory, evaluate_controller
from training.record.__main__ import main
from training.record.rollout import rollout_frames

SMALL = ("--physics", "planar", "--width", "320", "--height", "240", "--fps", "10")


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    """Return what the program wrote of an episode of standing still, and what it printed."""
    out = tmp_path_factory.mktemp("video") / "still.mp4"
    assert run(main, ["still", *SMALL, "--out", str(out), "--still", str(out.with_suffix(".png"))]) == 0
    return out


def test_the_video_is_the_episode_that_is_evaluated(video, paper, read_video):
    frames, fps = read_video(video)
    episode = evaluate_controller(controller_factory("still", paper), Setup(paper), [0]).episodes[0]
    assert frames.shape == (1 + round(10 * episode.duration_s) + 10, 240, 320, 3)
    assert fps == 10


def test_the_plots_are_under_the_picture(video):
    picture = iio.imread(video.with_suffix(".png"))
    assert picture[:160].mean() > 2.0 * picture[170:].mean()  # a bright field over dark paper
    assert picture[170:].std() > 5.0


def test_pictures_between_two_steps_are_between_them(paper):
    env = TankendoEnv(model=paper, action_mode="command")
    frames = rollout_frames(env, Still(), paper, "planar", width=320, height=240, fps=20)
    first, between, after = (next(frames)[60:160].astype(float) for _ in range(3))
    frames.close()
    assert 0.0 < np.abs(between - first).mean() < np.abs(after - first).mean()


def test_bad_arguments_are_one_sentence(tmp_path, capsys):
    picture = str(tmp_path / "a.png")
    for arguments, message in (
        (("still", "--env", "MecanumTankendo-v1"), "did you mean"),
        (("still", "--out", "a.gif"), "must end in .mp4"),
        (("still", "--width", "321"), "width = 321 pixels, must be an even number from 320 to 8192"),
        (("still", "--height", "100000"), "height = 100000 pixels, must be an even number from 240 to 8192"),
        (("still", "--seed", "-1"), "seed = -1, must be at least 0"),
        (("still", "--still-time", "1"), "there is no still; add --still"),
        (
            ("still", "--still", picture, "--still-time", "-1"),
            "still_time = -1, must be within the film, 0 to",
        ),
        (("still", "--still", picture, "--still-time", "nan"), "still_time = nan, must be within the film"),
        (("still", "--still", picture, "--still-time", "13.1"), "must be within the film, 0 to 13 s"),
        (("still", "--still", "/dev/null/a.png"), "a.png: cannot be written"),
        (("still", "--on", "moon"), "no plant 'moon'"),
        (("stil",), 'did you mean "still"'),
    ):
        assert (
            run(main, [*arguments, *(() if "--out" in arguments else ("--out", str(tmp_path / "a.mp4")))])
            == 2
        )
        assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_frame_rate_of_nothing_is_refused(paper):
    env = TankendoEnv(model=paper, action_mode="command")
    with pytest.raises(InputError, match="fps = 0"):
        rollout_frames(env, Still(), paper, "planar", fps=0.0)
