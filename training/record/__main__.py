"""A video of a controller at work: `python -m training.record CONTROLLER`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Literal

import tyro

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.programs import Done
from mecanum_env.rendering.backend import use_backend


def main(
    controller: tyro.conf.Positional[str],
    /,
    env: str = "MecanumTankendo-v0",
    seed: int = 0,
    out: Path = Path("video.mp4"),
    model: Path | None = None,
    on: str = "nominal",
    physics: Literal["planar", "rollers"] = "rollers",
    difficulty: str = "normal",
    width: int = 640,
    height: int = 480,
    fps: float = 30.0,
    still: Path | None = None,
    still_time: float | None = None,
) -> Done:
    """Film one episode: the fight, the score, and the commanded against the actual speed.

    Pictures are drawn without a screen, by OSMesa if it is installed. The episode is the one that the same
    seed has in a certificate.

    Example: python -m training.record retreat --seed 3 --out retreat.mp4

    Args:
        controller: Name of a controller or path of a trained policy; see python -m training.certify.
        env: Name of the environment.
        seed: Seed of the episode.
        out: Video to write (.mp4).
        model: Model file of the robot; by default the packaged one.
        on: Plant of a certificate, such as robot-level or with-backlash; the controller knows only the model.
        physics: rollers on a floor, or planar, whose wheels do not turn in the picture.
        difficulty: Difficulty of the opponent: easy, normal or hard.
        width: Width of the video [pixels].
        height: Height of the video, plots included [pixels].
        fps: Frames per second.
        still: Also write one frame to this file (.png, .jpg).
        still_time: Time of that frame after the start [s], by default 1; the last one if the episode is over.
    """
    # Before anything imports mujoco, which picks its graphics library then.
    backend = use_backend()
    from mecanum_env.files import require_writable
    from mecanum_env.model import paper_model, read_model
    from mecanum_env.outputs import output_files
    from mecanum_env.rendering import video
    from training.record.film import STILL_S, Film

    known = paper_model() if model is None else read_model(model)
    film = Film(controller, known, env, seed, on, physics, difficulty, width, height, fps)
    video.check_suffix(out, (".mp4",))
    if still is not None:
        video.check_suffix(still, video.STILL_SUFFIXES)
    elif still_time is not None:
        raise InputError(f"still_time = {still_time:g}: there is no still; add --still PICTURE.png")
    targets = [out] if still is None else [out, still]
    require_writable(*targets)
    still_s = STILL_S if still_time is None else still_time
    film.require_within(still_s)
    frames = film.frames()
    with output_files("training.record", *targets, seed=seed) as staged:
        count = film.write(frames, staged[0], staged[1] if still is not None else None, still_s)
    print(f"{out}: {controller}, seed {seed}: {film.outcome()}; {count} frames, ", end="")
    print(f"{width} x {height}, drawn with {backend}")
    if still is not None:
        print(f"{still}: {width} x {height}")
    return Done(wrote=targets)


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m training.record"))
