"""Offline pictures and videos of a simulated drive.

Call `mecanum_env.rendering.backend.use_backend` before importing this module, since mujoco chooses its
graphics library when it is imported.
"""

from __future__ import annotations

import copy
import math
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import imageio.v2 as iio2
import imageio.v3 as iio
import mujoco
import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.files import atomic_path
from mecanum_env.rendering.view import Frame, View, draw_caption
from mecanum_env.simulator.trajectory import Trajectory

_FPS = 30.0
"""Default number of frames per second of simulated time, and of the video."""
STILL_SUFFIXES = (".png", ".jpg", ".jpeg")
"""Endings of the names of pictures."""

_LIGHT_SLICES, _LIGHT_STACKS = 14, 8
"""Slices and stacks of a round shape in light quality; MuJoCo's defaults are 28 and 16."""
_LIGHT_SHADOW_PX = 1024
"""Largest shadow map in light quality [pixels]."""
_LIGHT_CASTS_SHADOW_M = 0.05
"""Bounding radius [m] below which parts (bolts, rollers, joints) cast no shadow in light quality."""
_WIDEST_CAPTION = "command  V  -000 rpm   theta  -000 deg   VC  -000 rpm"


def render_frames(
    trajectory: Trajectory, view: View | None = None, rows: Iterable[int] | None = None
) -> Iterator[Frame]:
    """Yield pictures (height, width, 3) of a drive, seen as `View()` by default.

    `rows` are the physics steps to draw, as from `frame_rows`; `_FPS` frames per second when None.

    Raises:
        InputError: the model has no such camera.
    """
    view = View() if view is None else view
    rows = frame_rows(trajectory.time_s) if rows is None else rows
    model = _prepare(trajectory.mj_model, view)
    data = mujoco.MjData(model)
    with mujoco.Renderer(model, view.height, view.width) as renderer:
        if view.quality == "light":
            renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        for row in rows:
            data.qpos[:] = trajectory.qpos[row]
            # The part of mj_forward that drawing needs: positions of bodies, cameras and lights.
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_camlight(model, data)
            renderer.update_scene(data, view.camera)
            frame: Frame = renderer.render()
            if view.caption:
                draw_caption(frame, caption_lines(trajectory, row), _WIDEST_CAPTION)
            yield frame


def frame_rows(time_s: npt.NDArray[np.float64], fps: float = _FPS) -> npt.NDArray[np.intp]:
    """Return the rows of increasing times (n,) [s] nearest to the frame times 0, 1/fps ... within the drive.

    Raises:
        InputError: `fps` is not a number above 0.
    """
    if not (math.isfinite(fps) and fps > 0.0):
        raise InputError(f"fps = {fps}, must be a number above 0, such as {_FPS:g}")
    n = int(np.floor((time_s[-1] - time_s[0]) * fps + 1e-6)) + 1
    return nearest_rows(time_s, time_s[0] + np.arange(n) / fps)


def nearest_rows(time_s: npt.NDArray[np.float64], wanted_s: npt.ArrayLike) -> npt.NDArray[np.intp]:
    """Return the rows of the increasing times `time_s`, shape (n,), nearest to `wanted_s`, shape (...)."""
    midpoints = (time_s[1:] + time_s[:-1]) / 2
    return np.asarray(np.searchsorted(midpoints, wanted_s))


def write_video(path: str | os.PathLike[str], frames: Iterable[Frame], fps: float = _FPS) -> int:
    """Encode frames as H.264 in an mp4 file, whole or not at all, and return how many there were.

    The path ends in .mp4; all frames have one size (height, width, 3), both even, and are shown `fps` a
    second.

    Raises:
        InputError: the name does not end in .mp4, there is no frame, or its size is odd.
    """
    path = check_suffix(path, (".mp4",))
    count = 0
    with atomic_path(path) as temporary:
        # A fast preset, since software rendering needs the processor, and almost lossless. The index goes to
        # the front, so that a browser can start to play while it loads.
        options = ["-preset", "veryfast", "-crf", "18", "-movflags", "+faststart"]
        writer: Any = iio2.get_writer(
            temporary, fps=fps, codec="libx264", quality=None, macro_block_size=1, output_params=options
        )
        # Not `with writer`, which leaves the encoder running if its block raises.
        with closing(writer):
            for frame in frames:
                height, width = frame.shape[:2]
                if height % 2 or width % 2:
                    even = f"{width + width % 2} x {height + height % 2}"
                    raise InputError(f"{path}: {width} x {height}, an H.264 video needs even sizes: {even}")
                writer.append_data(frame)
                count += 1
        if count == 0:
            raise InputError(f"{path}: nothing to write, the drive has no frame")
    return count


def write_still(path: str | os.PathLike[str], frame: Frame) -> None:
    """Write one frame (height, width, 3) as .png or .jpg, whole or not at all.

    Raises:
        InputError: the name ends in neither.
    """
    path = check_suffix(path, STILL_SUFFIXES)
    with atomic_path(path) as temporary:
        iio.imwrite(temporary, frame)


def check_suffix(path: str | os.PathLike[str], suffixes: Sequence[str]) -> Path:
    """Return the path if it ends in one of the suffixes.

    Raises:
        InputError: it does not.
    """
    path = Path(path)
    if path.suffix not in suffixes:
        raise InputError(f"{path}: its name must end in {' or '.join(suffixes)}")
    return path


def caption_lines(trajectory: Trajectory, row: int) -> list[str]:
    """Return time, command and actual motion at one row of a trajectory, as lines of text."""
    command = np.rint(trajectory.command[row]) + 0.0  # adding 0.0 turns -0.0, which prints as "-0", into 0.0
    vx, vy = np.round(trajectory.twist[row, :2], 2) + 0.0
    turning = np.rint(np.rad2deg(trajectory.twist[row, 2])) + 0.0
    if len(command) == 3:
        sent = f"command  V {command[0]:.0f} rpm   theta {command[1]:.0f} deg   VC {command[2]:.0f} rpm"
    else:
        sent = "command  " + "   ".join(f"{c:.0f}" for c in command) + " rpm"
    return [
        f"{trajectory.time_s[row]:.2f} s",
        sent,
        f"actual  vx {vx:+.2f} m/s   vy {vy:+.2f} m/s   yaw {turning:+.0f} deg/s",
    ]


def _prepare(mj_model: mujoco.MjModel, view: View) -> mujoco.MjModel:
    """Return a copy of the model with the quality and offscreen buffer of a view."""
    names = [mj_model.camera(i).name for i in range(mj_model.ncam)]
    if view.camera not in names:
        raise InputError(
            f"no camera {view.camera!r} in this model{did_you_mean(view.camera, names)}; "
            f"it has {', '.join(names) or 'none'}"
        )
    model = copy.copy(mj_model)
    # No larger than the picture, since the whole buffer is cleared and resolved for every frame.
    model.vis.global_.offwidth, model.vis.global_.offheight = view.width, view.height
    if view.quality == "light":
        lighten(model)
    return model


def lighten(model: mujoco.MjModel) -> None:
    """Reduce a model's drawing quality where a software renderer gains most; see docs/rendering.md."""
    quality = model.vis.quality
    quality.offsamples = 0
    quality.numslices, quality.numstacks = _LIGHT_SLICES, _LIGHT_STACKS
    quality.shadowsize = min(_LIGHT_SHADOW_PX, quality.shadowsize)
    # Planes have the bounding radius 0 and are not meant.
    small = (model.geom_rbound > 0.0) & (model.geom_rbound < _LIGHT_CASTS_SHADOW_M)
    if hasattr(model, "geom_castshadow"):  # since MuJoCo 4
        model.geom_castshadow[small] = False
    # Infinite ground below a mat is shaded in every pixel that the mat then covers, so it is hidden.
    planes = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    endless = planes & np.all(model.geom_size[:, :2] == 0.0, axis=1)
    if np.any(planes & ~endless):
        model.geom_matid[endless] = -1
        model.geom_rgba[endless, 3] = 0.0
