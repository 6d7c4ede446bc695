"""`python -m mecanum_env.render`: a video or a still of a model driving through commands."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.model import paper_model, read_model
from mecanum_env.programs import Done
from mecanum_env.rendering.backend import use_backend
from mecanum_env.rendering.view import Quality, View

if TYPE_CHECKING:
    from mecanum_env.simulator import Commands


def render(
    model: Annotated[str, tyro.conf.Positional] = "paper",
    /,
    commands: str = "tour",
    out: Path | None = None,
    still: Path | None = None,
    still_time: float | None = None,
    plant: Literal["rollers", "planar"] = "rollers",
    camera: str = "track",
    width: int = 640,
    height: int = 480,
    fps: float = 30.0,
    quality: Quality = "light",
    duration: float | None = None,
    caption: bool = True,
) -> Done:
    """Drive a model through commands and write a video, a still picture, or both.

    Example: python -m mecanum_env.render fit/model.json --commands tour --out rollout.mp4

    Args:
        model: path of a model.json, or "paper" for the packaged model.
        commands: forward, sideways, diagonal, rotate or tour; or a file with the columns time_s and
            command_v_rpm, command_theta_deg, command_vc_rpm (or command_{fl,fr,rl,rr}_rpm).
        out: file of the video (.mp4); rollout.mp4 if neither this nor --still is given.
        still: file of a picture (.png, .jpg).
        still_time: time of the picture [s]; the middle of the drive by default.
        plant: rollers on a floor, or the fast planar plant, whose wheels do not turn in the picture.
        camera: track, close, side, overview or top.
        width: width of the picture [pixels].
        height: height of the picture [pixels].
        fps: frames per second.
        quality: light is several times faster; full has reflections and smooth edges.
        duration: length of the drive [s]; by default that of the named drive, or 1 s more than the last
            stamp of the file.
        caption: write time, command and motion into the picture.
    """
    # Before anything imports mujoco, which chooses its graphics library then.
    backend = use_backend()
    from tqdm import tqdm

    from mecanum_env.files import require_writable
    from mecanum_env.outputs import output_files
    from mecanum_env.rendering import video
    from mecanum_env.simulator import drive

    view = View(camera, width, height, quality, caption)
    if out is None and still is None:
        out = Path("rollout.mp4")
    if out is not None:
        video.check_suffix(out, (".mp4",))
    if still is not None:
        video.check_suffix(still, video.STILL_SUFFIXES)
    targets = [path for path in (out, still) if path is not None]
    require_writable(*targets)
    chosen = paper_model() if model == "paper" and not Path(model).exists() else read_model(model)
    sent, length = _commands(commands)
    length = length if duration is None else duration
    if still_time is not None and not 0.0 <= still_time <= length:
        raise InputError(f"still_time = {still_time}, must be within the drive, 0 to {length:g} s")
    trajectory = drive(chosen, sent, length, plant=plant)
    said = []
    with output_files("mecanum_env.render", *targets) as paths:
        if still is not None:
            row = video.nearest_rows(trajectory.time_s, length / 2 if still_time is None else still_time)
            (frame,) = video.render_frames(trajectory, view, [int(row)])
            video.write_still(paths[-1], frame)
            said = [f"{still}: {width} x {height} at {trajectory.time_s[row]:.2f} s, drawn with {backend}"]
        if out is not None:
            rows = video.frame_rows(trajectory.time_s, fps)
            bar = tqdm(rows, desc="drawing", unit="frame", disable=None)
            count = video.write_video(paths[0], video.render_frames(trajectory, view, bar), fps)
            size = f"{width} x {height}"
            said += [f"{out}: {count} frames, {length:.1f} s, {size}, drawn with {backend}"]
    print("\n".join(said))
    return Done(wrote=targets)


def _commands(name: str) -> tuple[Commands, float]:
    """Return the commands of a named drive or a file, and how long to drive [s]."""
    from mecanum_env.simulator import SCRIPTS, read_commands, scripted

    # A name without "." and "/" is not meant as a file, so it may be a misspelt drive.
    if name in SCRIPTS or ("." not in name and "/" not in name):
        return scripted(name)
    sent = read_commands(name)
    return sent, float(sent.time_s[-1]) + 1.0


if __name__ == "__main__":
    raise SystemExit(run(render, prog="python -m mecanum_env.render"))
