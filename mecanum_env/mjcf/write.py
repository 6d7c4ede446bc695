"""Writing the models as MJCF files that any MuJoCo program opens, once this package is installed."""

from __future__ import annotations

import os
from pathlib import Path

import mujoco

from mecanum_env.errors import EffectRefusedError
from mecanum_env.files import write_text
from mecanum_env.mjcf.plants import bench_spec, planar_spec, robot_spec
from mecanum_env.model import Model

SPECS = {"robot.xml": robot_spec, "planar.xml": planar_spec, "bench.xml": bench_spec}


def mjcf_text(spec: mujoco.MjSpec) -> str:
    """Return a spec as MJCF whose numbers read back exactly; the spec is not changed.

    MuJoCo writes the values that compilation made with six digits: a sample period of 0.00833333 s would no
    longer be four steps of 0.00208333 s, and the wheel law would run off the clock. What the spec itself says
    it writes in as many digits as it takes.
    """
    compiled = spec.compiler.savecompiled
    spec.compiler.savecompiled = False
    try:
        return str(spec.to_xml())
    finally:
        spec.compiler.savecompiled = compiled


def left_out(model: Model) -> dict[str, str]:
    """Return which files, of all but robot.xml, a model's effects forbid, and the reason of each."""
    reasons = {}
    for name, make in SPECS.items():
        if name == "robot.xml":
            continue
        try:
            make(model, visuals=False)
        except EffectRefusedError as error:
            reasons[name] = str(error)
    return reasons


def write_models(model: Model, out: str | os.PathLike[str]) -> list[Path]:
    """Write robot.xml, planar.xml and bench.xml of a model into the folder `out`; return their paths.

    All but robot.xml may be left out where a plant cannot express an effect; `left_out` says why.

    Raises:
        InputError: an effect that the robot refuses, impossible inertia, or a folder that cannot be written.
    """
    # All texts before the first file: bad input leaves nothing behind.
    skip = left_out(model)
    texts = {name: mjcf_text(make(model)) for name, make in SPECS.items() if name not in skip}
    for name, text in texts.items():
        write_text(Path(out) / name, text)
    return [Path(out) / name for name in texts]
