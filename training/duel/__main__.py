"""Two controllers against each other: `python -m training.duel A B`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Literal

import tyro

from mecanum_env.cli import run
from mecanum_env.programs import Done
from mecanum_env.rendering.backend import use_backend


def main(
    a: tyro.conf.Positional[str],
    b: tyro.conf.Positional[str],
    /,
    episodes: int = 100,
    first_seed: int = 0,
    model: Path | None = None,
    physics: Literal["planar", "rollers"] = "planar",
    difficulty: str = "normal",
    video: Path | None = None,
    video_seed: int = 0,
) -> Done:
    """Let two controllers fight bouts, best of three; print who won what share.

    Each seed is fought twice, the second time with the players exchanged.

    Example: python -m training.duel retreat sidestep --episodes 100 --video bout.mp4

    Args:
        a: Name of a controller or path of a trained policy; see python -m training.certify.
        b: The other one.
        episodes: Number of bouts.
        first_seed: Seed of the first two bouts; the next two have the next one.
        model: Model file of both robots; by default the packaged one.
        physics: planar, whose wheels never slip, or rollers on a floor.
        difficulty: How well the robots' swords strike: easy, normal or hard.
        video: Also film a bout into this file (.mp4).
        video_seed: Seed of that bout.
    """
    # Before anything imports mujoco, which picks its graphics library then.
    if video is not None:
        use_backend()
    from mecanum_env.files import require_writable
    from mecanum_env.model import paper_model, read_model
    from mecanum_env.rendering.video import check_suffix, write_video
    from training.duel.film import FPS, bout_frames
    from training.duel.match import play_match, player_factory

    if video is not None:
        check_suffix(video, (".mp4",))
        require_writable(video)
    robot = paper_model() if model is None else read_model(model)
    both = player_factory(a, robot), player_factory(b, robot)
    result = play_match(
        *both, episodes, first_seed=first_seed, model=robot, plant=physics, difficulty=difficulty
    )
    names = {"A": f"A {a}", "B": f"B {b}", "draw": "draw"}
    width = max(map(len, names.values()))
    shares = result.shares()
    for who, (share, low, high) in shares.items():
        print(f"{names[who]:{width}}  {share:.2f} ({low:.2f} .. {high:.2f})")
    each = f"{result.points / episodes:.2f} : {result.points_against / episodes:.2f}"
    print(f"points a bout {each}, {episodes} bouts of {result.seconds:.1f} s on average")
    if video is not None:
        frames = bout_frames(both, (a, b), video_seed, model=robot, plant=physics, difficulty=difficulty)
        count = write_video(video, frames, FPS)
        print(f"{video}: {count} frames")
    return Done(wrote=[] if video is None else [video], found={"shares": shares, "seconds": result.seconds})


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m training.duel"))
