"""What this machine has of what the programs need: versions, the plugin, drawing and video."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import platform
import subprocess
import sys
from dataclasses import asdict, dataclass
from typing import Final

from mecanum_env.checkout import checkout
from mecanum_env.errors import MecanumError, install_command
from mecanum_env.programs import Done
from mecanum_env.rendering.backend import choose_backend
from mecanum_env.version import __version__

_SECONDS: Final = 120
_PACKAGES: Final = ("mujoco", "mujoco-core", "numpy", "scipy", "gymnasium", "matplotlib", "jinja2", "tyro")
"""Distributions whose versions matter in a report of a fault; those that are absent are not shown."""
EXTRAS: Final = {
    **{"train": "stable_baselines3", "bag": "rosbags", "parquet": "pyarrow", "mcap": "mcap", "onnx": "onnx"},
    **{"view": "websockets", "duel": "pettingzoo", "ray": "ray", "zoo": "numba", "gapbench": "cma"},
    **{"peers": "sippy_unipi", "docs": "furo"},
}
"""Extra -> a module that it installs."""
_PLUGIN: Final = """
import mecanum_env.plugin.layout, mujoco
from mecanum_env import BodyCommands, drive, paper_model
from mecanum_env.plugin import library_path
drive(paper_model(), BodyCommands.constant(v_rpm=60.0), 0.1)
print(library_path(mujoco.mj_versionString()))
"""
_RENDERER: Final = """
from mecanum_env.rendering.backend import use_backend
backend = use_backend()
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 32, 32) as renderer:
    renderer.update_scene(data)
    assert renderer.render().any()
print(backend)
"""
_VIDEO: Final = "import imageio_ffmpeg; print(imageio_ffmpeg.get_ffmpeg_exe())"


@dataclass(frozen=True)
class Check:
    """One thing that programs need."""

    name: str
    passed: bool
    found: str
    """What is there, or why it does not work."""
    advice: str = ""
    """What to do where it is missing."""


def doctor() -> Done:
    """Say whether this machine has what the programs need, and what to do where it has not.

    Example: mecanum doctor

    Returns:
        The exit code: 0, or 3 if something is missing.
    """
    checks = (
        _by_running("plugin", _PLUGIN, "install one of the releases of mujoco that the message names"),
        _renderer(),
        _by_running("video", _VIDEO, "`pip install --force-reinstall imageio-ffmpeg`"),
    )
    versions = {"mecanum-tankendo": __version__, "python": platform.python_version(), **_versions()}
    extras = {name: importlib.util.find_spec(module) is not None for name, module in EXTRAS.items()}
    print(", ".join(f"{name} {version}" for name, version in versions.items()))
    print(f"{platform.platform()}, {'checkout' if checkout() else 'installed'} at {sys.prefix}")
    for check in checks:
        print(f"{'ok' if check.passed else 'MISSING':8}{check.name}: {check.found}")
        if not check.passed:
            print(f"{'':8}{check.advice}")
    missing = [name for name, there in extras.items() if not there]
    print(f"{'':8}extras: {', '.join(name for name in extras if extras[name]) or 'none'}", end="")
    print(f"; not installed: {', '.join(missing)} ({install_command(missing[0])})" if missing else "")
    found = {"versions": versions, "checks": [asdict(check) for check in checks], "extras": extras}
    return Done(0 if all(check.passed for check in checks) else 3, found=found)


def _renderer() -> Check:
    try:
        choose_backend()
    except MecanumError as error:
        return Check("renderer", False, str(error), "only pictures and videos need it")
    return _by_running("renderer", _RENDERER, "try MUJOCO_GL=osmesa or MUJOCO_GL=egl (docs/rendering.md)")


def _by_running(name: str, program: str, advice: str) -> Check:
    """Run a program in an interpreter of its own, since a broken graphics library may end the process."""
    command = [sys.executable, "-c", program]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        return Check(name, False, f"no answer in {_SECONDS} s", advice)
    if done.returncode == 0:
        return Check(name, True, done.stdout.strip())
    said = done.stderr.strip().splitlines()
    return Check(name, False, said[-1] if said else f"ended with code {done.returncode}", advice)


def _versions() -> dict[str, str]:
    installed = {dist.metadata["Name"].lower(): dist.version for dist in importlib.metadata.distributions()}
    return {name: installed[name] for name in _PACKAGES if name in installed}
