"""`python -m mecanum_env.mjcf`: write a model's MJCF files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from mecanum_env.asset_files import asset_path
from mecanum_env.cli import run
from mecanum_env.mjcf.write import write_models
from mecanum_env.model import read_model


def main(model: Annotated[Path | None, tyro.conf.Positional] = None, /, out: Path = Path("mjcf")) -> None:
    """Write robot.xml, planar.xml and bench.xml of a model file, for any program that opens MJCF.

    Example: python -m mecanum_env.mjcf fit/model.json --out fit/mjcf

    Args:
        model: the model file; by default the packaged model of the paper.
        out: the folder to write into.
    """
    chosen = asset_path("models/paper.json") if model is None else model
    for path in write_models(read_model(chosen), out):
        print(path)


if __name__ == "__main__":
    raise SystemExit(run(main, prog="python -m mecanum_env.mjcf"))
