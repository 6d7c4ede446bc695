"""Writing the models as MJCF files that any MuJoCo program opens, once this package is installed."""

from __future__ import annotations

import ctypes
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import mujoco

from mecanum_env.files import write_text
from mecanum_env.mjcf.bench import bench_spec
from mecanum_env.mjcf.planar import planar_spec
from mecanum_env.mjcf.robot import robot_spec
from mecanum_env.model import Model

SPECS = {"robot.xml": robot_spec, "planar.xml": planar_spec, "bench.xml": bench_spec}

_NUMBER = re.compile(r"(?<![\w#])-?\d+\.?\d*(?:e[-+]?\d+)?(?![\w.])")
_DIGITS = 17


def mjcf_text(spec: mujoco.MjSpec) -> str:
    """Return a spec as MJCF whose numbers read back exactly.

    MuJoCo writes six digits: a sample period of 0.00833333 s would no longer be four steps of 0.00208333 s,
    and the wheel law would run off the clock. So the writer is told to use 17, and each number is then
    shortened to the fewest digits that mean the same double.
    """
    spec.compiler.savecompiled = False
    with _written_precision(_DIGITS):
        text = spec.to_xml()
    return re.sub(r'="([^"]*)"', lambda match: '="' + _NUMBER.sub(_shortest, match.group(1)) + '"', text)


def write_models(model: Model, out: str | os.PathLike[str]) -> list[Path]:
    """Write robot.xml, planar.xml and bench.xml of a model into the folder `out`; return their paths.

    Raises:
        InputError: an effect that is not simulated, impossible inertia, or a folder that cannot be written.
    """
    # All texts before the first file: bad input leaves nothing behind.
    texts = {name: mjcf_text(make(model)) for name, make in SPECS.items()}
    for name, text in texts.items():
        write_text(Path(out) / name, text)
    return [Path(out) / name for name in texts]


def _shortest(match: re.Match[str]) -> str:
    value = float(match.group())
    return str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)


@contextmanager
def _written_precision(digits: int) -> Iterator[None]:
    """Let MuJoCo write this many digits. The switch is not public; the release is pinned, so it is there."""
    (library,) = Path(mujoco.__file__).parent.glob("*mujoco.*4.0.0*")
    switch = ctypes.CDLL(str(library))
    before = switch._mjPRIVATE__get_xml_precision()
    switch._mjPRIVATE__set_xml_precision(digits)
    try:
        yield
    finally:
        switch._mjPRIVATE__set_xml_precision(before)
