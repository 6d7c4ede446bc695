"""Write a trained policy for other computers: `python -m training.export POLICY --out FOLDER`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Literal

import tyro

from mecanum_env.cli import run
from mecanum_env.programs import Done


def export(
    policy: tyro.conf.Positional[str],
    /,
    out: Path = Path("export"),
    model: Path | None = None,
    formats: Literal["all", "c"] = "all",
) -> Done:
    """Write policy.onnx, a dependency-free C header policy.h, and their contract, policy.json.

    Example: python -m training.export robust --out out/export

    Args:
        policy: A bundled policy (nominal, planned, predicting, robust, timing, varied), or the file or folder
            of a trained one.
        out: Folder to write.
        model: Model of the robot that it was trained on; by default the one that the policy names.
        formats: c leaves out policy.onnx, which needs the extra onnx.
    """
    from mecanum_env.model import read_model
    from training.controllers.policy import bundled, policy_path
    from training.export import export_policy

    source = policy_path(policy) or bundled(policy)
    known = None if model is None else read_model(model)
    written = export_policy(source, out, known, onnx=formats == "all")
    print(f"wrote {', '.join(map(str, written))}")
    return Done(wrote=written)


if __name__ == "__main__":
    sys.exit(run(export, prog="python -m training.export"))
