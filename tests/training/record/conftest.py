"""What the tests of videos share."""

import gc
import warnings

import imageio.v3 as iio
import pytest


@pytest.fixture(scope="session")
def read_video():
    """Return a function that reads an mp4 file back: pictures (n, height, width, 3) and frames per second."""

    def read(path):
        # imageio forgets to close a pipe of its own reader; the warning is let go here, where it arises.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)
            frames, fps = iio.imread(path), iio.immeta(path)["fps"]
            gc.collect()
        return frames, fps

    return read
