"""All controllers in one table: `python -m training.compare`."""

from __future__ import annotations

import shlex
import sys
from dataclasses import asdict
from pathlib import Path

import tyro

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.parallel import Workers
from mecanum_env.programs import Done


def main(
    controllers: tyro.conf.Positional[tuple[str, ...]] = (),
    /,
    model: Path | None = None,
    episodes: int = 200,
    rollers: bool = True,
    adversary: bool = True,
    bound: bool = True,
    workers: tyro.conf.OmitArgPrefixes[Workers] = Workers(),
    out: Path = Path("compare.json"),
    markdown: Path | None = None,
) -> Done:
    """Play controllers on the same episodes; print success, its bound, warning needed, tracking, times.

    Example: python -m training.compare retreat mpc robust out/ppo --episodes 100 --markdown out/compare.md

    Args:
        controllers: Names of controllers or bundled policies, or paths of trained policies; see python -m
            training.certify. By default all controllers, the oracle among them, and the policy.
        model: Model file of the robot; by default the packaged one.
        episodes: Number of episodes per controller and setting, with the seeds 0, 1, ...
        rollers: Play on rollers too, which takes most of the time.
        adversary: Also search an opponent against each controller, which takes 4,320 episodes.
        bound: Also play the oracle on every planar plant, for what could be won at best.
        workers: Where the episodes are played.
        out: File for the results (.json).
        markdown: Also write a page to this file (.md).
    """
    # Imported here, so that --help does not wait for the library.
    from tqdm import tqdm

    from mecanum_env.files import require_writable, write_json, write_text
    from mecanum_env.model import paper_model, read_model
    from mecanum_env.outputs import output_files
    from training.certify.adversary import Search
    from training.compare.comparison import compare_controllers
    from training.compare.report import comparison_markdown, comparison_table
    from training.controllers.named import CONTROLLERS

    for path, suffix in ((out, ".json"), (markdown, ".md")):
        if path is not None:
            if path.suffix != suffix:
                raise InputError(f"{path}: its name must end in {suffix}")
            require_writable(path)
    robot = paper_model() if model is None else read_model(model)
    with tqdm(unit="episode", disable=None) as bar:

        def progress(name: str, count: int) -> None:
            bar.set_description(name)
            bar.update(count)

        found = compare_controllers(
            controllers or tuple(CONTROLLERS),
            robot,
            episodes=episodes,
            rollers=rollers,
            search=Search() if adversary else None,
            bound=bound,
            workers=workers,
            progress=progress,
        )
    written = [out] if markdown is None else [out, markdown]
    with output_files("training.compare", *written) as (result, *page):
        write_json(result, {"format": "mecanum-comparison/1", **asdict(found)})
        if page:
            given = shlex.join(["python", "-m", "training.compare", *sys.argv[1:]])
            write_text(page[0], comparison_markdown(found, given))
    print(comparison_table(found))
    print(f"\nwrote {', '.join(map(str, written))}")
    return Done(wrote=written)


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m training.compare"))
