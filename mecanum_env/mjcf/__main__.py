"""`python -m mecanum_env.mjcf`: write a model's MJCF files."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import tyro

from mecanum_env.cli import run
from mecanum_env.programs import Done


def main(model: Annotated[Path | None, tyro.conf.Positional] = None, /, out: Path = Path("mjcf")) -> Done:
    """Write robot.xml, planar.xml and bench.xml of a model file, for any program that opens MJCF.

    A plant that cannot express one of the model's effects is left out, with its reason.

    Example: python -m mecanum_env.mjcf fit/model.json --out fit/mjcf

    Args:
        model: the model file; by default the packaged model of the paper.
        out: the folder to write into.
    """
    from mecanum_env.mjcf.plants import left_out, write_models
    from mecanum_env.model import paper_model, read_model

    read = paper_model() if model is None else read_model(model)
    written = write_models(read, out)
    for path in written:
        print(path)
    for name, reason in left_out(read).items():
        print(f"{name} is left out: {reason}", file=sys.stderr)
    return Done(wrote=written)


if __name__ == "__main__":
    raise SystemExit(run(main, prog="python -m mecanum_env.mjcf"))
