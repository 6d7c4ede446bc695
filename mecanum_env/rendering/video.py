"""Offline pictures and videos of a simulated drive.

Import this module after `mecanum_env.rendering.backend.use_backend`: mujoco picks its graphics library when it
is imported.
"""

from __future__ import annotations

import copy
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import imageio.v2 as iio2
import imageio.v3 as iio
import mujoco
import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from mecanum_env.errors import InputError
from mecanum_env.files import atomic_path
from mecanum_env.simulator.trajectory import Trajectory

Quality = Literal["light", "full"]
Frame = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class View:
    """How to look at the robot.

    "light" leaves out reflections and multisampling and takes a smaller shadow map, which software renderers
    draw several times faster; "full" keeps everything.
    """

    camera: str = "track"
    """A camera of the model by name."""
    width: int = 640
    height: int = 480
    quality: Quality = "light"
    caption: bool = True
    """Draw time, command and actual motion into the picture."""


def render_frames(trajectory: Trajectory, view: View, fps: float = 30.0) -> Iterator[Frame]:
    """Yield pictures (height, width, 3) of a drive at `fps` frames per second of simulated time.

    Raises:
        InputError: the model has no such camera, or the picture is larger than its offscreen buffer allows.
    """
    model = _prepare(trajectory.mj_model, view)
    data = mujoco.MjData(model)
    with mujoco.Renderer(model, view.height, view.width) as renderer:
        if view.quality == "light":
            renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        for row in frame_rows(trajectory.time_s, fps):
            data.qpos[:] = trajectory.qpos[row]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_camlight(model, data)
            renderer.update_scene(data, view.camera)
            frame: Frame = renderer.render()
            yield _caption(frame, trajectory, row) if view.caption else frame


def frame_rows(time_s: npt.NDArray[np.float64], fps: float) -> npt.NDArray[np.intp]:
    """Return the rows of `time_s` [s] nearest to the frame times 0, 1/fps, 2/fps ... within the drive."""
    n = int(np.floor((time_s[-1] - time_s[0]) * fps + 1e-9)) + 1
    rows: npt.NDArray[np.intp] = np.searchsorted(time_s, time_s[0] + np.arange(n) / fps - 1e-9)
    return rows


def write_video(path: str | os.PathLike[str], frames: Iterable[Frame], fps: float = 30.0) -> int:
    """Encode frames as H.264 in an mp4 file, whole or not at all, and return how many there were.

    Raises:
        InputError: the name does not end in .mp4, or there is no frame.
    """
    path = Path(path)
    if path.suffix != ".mp4":
        raise InputError(f"{path}: a video's name must end in .mp4")
    count = 0
    with atomic_path(path) as temporary:
        # libx264 wants even sizes; macro_block_size 2 asks for no more than that.
        with iio2.get_writer(temporary, fps=fps, codec="libx264", quality=7, macro_block_size=2) as writer:
            for frame in frames:
                writer.append_data(frame)
                count += 1
        if count == 0:
            raise InputError(f"{path}: nothing to write, the drive has no frame")
    return count


def write_still(path: str | os.PathLike[str], frame: Frame) -> None:
    """Write one picture (.png or .jpg), whole or not at all."""
    with atomic_path(path) as temporary:
        iio.imwrite(temporary, frame)


def _prepare(mj_model: mujoco.MjModel, view: View) -> mujoco.MjModel:
    """Return a copy of the model with the drawing quality set and an offscreen buffer that is large enough."""
    names = [mj_model.camera(i).name for i in range(mj_model.ncam)]
    if view.camera not in names:
        raise InputError(f"no camera {view.camera!r} in this model; it has {', '.join(names)}")
    model = copy.copy(mj_model)
    model.vis.global_.offwidth = max(view.width, model.vis.global_.offwidth)
    model.vis.global_.offheight = max(view.height, model.vis.global_.offheight)
    if view.quality == "light":
        model.vis.quality.offsamples = 0
        model.vis.quality.shadowsize = 1024
    return model


def _caption(frame: Frame, trajectory: Trajectory, row: int) -> Frame:
    """Draw time, command and actual motion over the picture's upper left corner."""
    command, (vx, vy, rate) = trajectory.command[row], trajectory.twist[row]
    if len(command) == 3:
        sent = f"command  V {command[0]:4.0f} rpm  theta {command[1]:4.0f} deg  VC {command[2]:4.0f} rpm"
    else:
        sent = "command  " + "  ".join(f"{c:4.0f}" for c in command) + " rpm"
    text = (
        f"{trajectory.time_s[row]:6.2f} s\n{sent}\n"
        f"actual   vx {vx:+.2f} m/s  vy {vy:+.2f} m/s  yaw {np.rad2deg(rate):+5.0f} deg/s"
    )
    picture = Image.fromarray(frame)
    draw = ImageDraw.Draw(picture, "RGBA")
    font = ImageFont.load_default(size=max(11, frame.shape[0] // 36))
    box = draw.multiline_textbbox((10, 8), text, font=font)
    draw.rectangle((box[0] - 6, box[1] - 5, box[2] + 6, box[3] + 5), fill=(0, 0, 0, 140))
    draw.multiline_text((10, 8), text, font=font, fill=(255, 255, 255, 255))
    return np.asarray(picture)
