import re

import imageio.v3 as iio
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.errors import InputError
from mecanum_env.rendering.video import (
    caption_lines,
    frame_rows,
    nearest_rows,
    render_frames,
    write_still,
    write_video,
)
from mecanum_env.rendering.view import View, draw_caption

SMALL = View(width=160, height=120, caption=False)


def grey(value, height=32, width=48):
    return np.full((height, width, 3), value, np.uint8)


@given(
    st.lists(st.floats(0.001, 1.0), min_size=1, max_size=30).map(lambda gaps: np.cumsum([0.0, *gaps])),
    st.floats(-1.0, 31.0),
)
def test_no_row_is_nearer_than_the_nearest(time, wanted):
    row = nearest_rows(time, wanted)
    assert np.abs(time[row] - wanted) == np.min(np.abs(time - wanted))


@pytest.mark.parametrize("fps", [0.7, 24.0, 30.0, 1000.0])
def test_frames_follow_simulated_time_to_the_end_and_not_beyond(fps):
    time = np.arange(961) / 480
    rows = frame_rows(time, fps)
    assert len(rows) == int(2.0 * fps + 1e-6) + 1
    assert np.max(np.abs(time[rows] - np.arange(len(rows)) / fps)) <= 0.5 / 480 + 1e-12


@pytest.mark.parametrize("fps", [0.0, -1.0, float("nan"), float("inf")])
def test_an_impossible_frame_rate_is_refused(fps):
    with pytest.raises(InputError, match=f"fps = {fps}"):
        frame_rows(np.arange(3.0), fps)


def test_an_unknown_camera_names_those_that_there_are(forward):
    with pytest.raises(InputError, match=r"no camera 'trakc'.*did you mean \"track\".*overview"):
        next(render_frames(forward, View(camera="trakc")))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [({"width": 0}, "width = 0"), ({"height": 99999}, "height = 99999"), ({"quality": "best"}, "quality")],
)
def test_an_impossible_view_is_refused(wrong, said):
    with pytest.raises(InputError, match=said):
        View(**wrong)


@pytest.mark.usefixtures("drawing")
def test_both_qualities_draw_one_scene(forward):
    pictures = [
        next(render_frames(forward, View(width=160, height=120, quality=q, caption=False), [0]))
        for q in ("light", "full")
    ]
    for picture in pictures:
        assert picture.shape == (120, 160, 3)
        assert picture.std() > 10
    assert not np.array_equal(*pictures)
    # The middle shows the robot on its mat alike; only edges, reflections and the backdrop differ.
    middle = [picture[40:110].astype(float) for picture in pictures]
    assert np.mean(np.abs(middle[0] - middle[1])) < 12


@pytest.mark.usefixtures("drawing")
def test_the_drive_and_its_model_are_left_as_they_were(forward):
    before = forward.qpos.copy(), forward.mj_model.vis.quality.shadowsize, forward.mj_model.geom_rgba.copy()
    next(render_frames(forward, SMALL, [0]))
    np.testing.assert_array_equal(forward.qpos, before[0])
    assert forward.mj_model.vis.quality.shadowsize == before[1]
    np.testing.assert_array_equal(forward.mj_model.geom_rgba, before[2])


@pytest.mark.usefixtures("drawing")
def test_the_caption_touches_its_box_alone(forward):
    plain, written = (
        next(render_frames(forward, View(width=320, height=240, caption=c), [240])) for c in (False, True)
    )
    rows, columns = np.nonzero(np.any(plain != written, axis=2))
    assert rows.size > 0
    assert rows.max() < 70
    assert columns.max() < 300
    # The letters are white, which nothing in the box is that is only darkened.
    box = written[: rows.max() + 1, : columns.max() + 1][rows.min() :, columns.min() :]
    assert np.count_nonzero(np.all(box > 200, axis=2)) > 100


def test_the_caption_says_time_command_and_motion(forward):
    time, command, actual = caption_lines(forward, 480)
    assert time == "1.00 s"
    assert command.split() == ["command", "V", "80", "rpm", "theta", "0", "deg", "VC", "0", "rpm"]
    vx = float(re.search(r"vx ([+-][\d.]+) m/s", actual).group(1))
    assert vx == pytest.approx(forward.twist[480, 0], abs=0.005)
    assert "-0 " not in actual


def test_a_caption_larger_than_the_picture_is_cut_off():
    frame = grey(200, 16, 16)
    draw_caption(frame, ["much too long for this"] * 5, "much too long for this")
    assert frame.shape == (16, 16, 3)


def test_a_video_reads_back_as_it_was_written(tmp_path, read_video):
    written = [grey(value) for value in (0, 80, 160, 240)]
    assert write_video(tmp_path / "a.mp4", iter(written), fps=12) == 4
    read, fps = read_video(tmp_path / "a.mp4")
    assert read.shape == (4, 32, 48, 3)
    assert np.max(np.abs(read.astype(int) - np.array(written))) <= 4
    assert fps == 12


def test_a_still_reads_back_exactly(tmp_path):
    picture = np.random.default_rng(0).integers(0, 255, (31, 47, 3), np.uint8)
    write_still(tmp_path / "a.png", picture)
    np.testing.assert_array_equal(iio.imread(tmp_path / "a.png"), picture)


@pytest.mark.parametrize("size", [(33, 48), (32, 49)])
def test_odd_sizes_are_no_video(tmp_path, size):
    with pytest.raises(InputError, match=rf"{size[1]} x {size[0]}, .* even sizes: "):
        write_video(tmp_path / "a.mp4", [grey(9, *size)])
    assert list(tmp_path.iterdir()) == []


def test_wrong_names_are_refused_before_drawing(tmp_path):
    with pytest.raises(InputError, match=r"a\.avi: its name must end in \.mp4"):
        write_video(tmp_path / "a.avi", [grey(1)])
    with pytest.raises(InputError, match=r"a\.mp4: its name must end in \.png"):
        write_still(tmp_path / "a.mp4", grey(1))


def test_a_drive_without_frames_writes_nothing(tmp_path):
    with pytest.raises(InputError, match="no frame"):
        write_video(tmp_path / "a.mp4", [])
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_video_leaves_what_was_there(tmp_path):
    target = tmp_path / "a.mp4"
    target.write_bytes(b"the one before")

    def interrupted():
        yield grey(10)
        yield grey(20)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_video(target, interrupted())
    assert target.read_bytes() == b"the one before"
    assert list(tmp_path.iterdir()) == [target]
