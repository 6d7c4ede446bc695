"""The plots under the picture: what was commanded and what was done, where they belong."""

import numpy as np
import pytest

from training.record.rollout import ACTUAL, COMMANDED, WINDOW_S, Panel, Strip

WIDTH, HEIGHT = 640, 154
PLOT = slice(41, 148)  # from the upper end of the axis to the lower
TIME = np.arange(0.0, 8.01, 0.1)


def drawn(commanded, actual, now_s=TIME[-1], panels=1):
    table = [np.repeat(np.array(values, float)[:, None], panels, axis=1) for values in (commanded, actual)]
    frame = Strip([Panel("speed", 1.0)] * panels, WIDTH, HEIGHT).draw(now_s, TIME, *table)
    assert frame.shape == (HEIGHT, WIDTH, 3)
    assert frame.dtype == np.uint8
    return frame[PLOT].astype(int)


def rows_of(frame, colour):
    """Return the rows of a colour's pixels, 0 at the upper end of the axis and 1 at its foot, and columns."""
    near = np.max(np.abs(frame - np.array(colour)), axis=-1) < 60
    rows, columns = np.nonzero(near)
    return rows / len(frame), columns / WIDTH


def test_commanded_and_actual_are_where_they_belong():
    frame = drawn(np.full(TIME.size, 0.5), np.full(TIME.size, -0.5))
    above, _ = rows_of(frame, COMMANDED)
    below, _ = rows_of(frame, ACTUAL)
    assert np.median(above) == pytest.approx(0.25, abs=0.02)
    assert np.median(below) == pytest.approx(0.75, abs=0.02)


def test_a_command_is_held_and_shown_for_the_last_seconds():
    command = np.where(TIME[-1] - WINDOW_S / 2 < TIME, 0.8, -0.8)
    rows, columns = rows_of(drawn(command, np.zeros(TIME.size)), COMMANDED)
    high, low = columns[rows < 0.3], columns[rows > 0.6]
    assert low.max() <= high.min() + 0.01
    assert high.min() == pytest.approx(0.53, abs=0.03)


def test_the_future_is_not_shown():
    step = np.where(TIME >= 4.0, 1.0, 0.0)
    rows, _ = rows_of(drawn(np.zeros(TIME.size), step, now_s=3.5), ACTUAL)
    assert rows.min() > 0.3
    rows, _ = rows_of(drawn(np.zeros(TIME.size), step, now_s=4.5), ACTUAL)
    assert rows.min() < 0.1


def test_what_is_beyond_the_axis_stays_within_its_plot():
    rows, columns = rows_of(drawn(np.full(TIME.size, 9.0), np.zeros(TIME.size), panels=3), COMMANDED)
    assert rows.max() < 0.1
    assert columns.min() > 0.0


def test_the_first_picture_has_nothing_to_plot():
    frame = Strip([Panel("speed", 1.0)], WIDTH, HEIGHT).draw(
        0.0, TIME[:1], np.zeros((1, 1)), np.zeros((1, 1))
    )
    assert frame.shape == (HEIGHT, WIDTH, 3)
