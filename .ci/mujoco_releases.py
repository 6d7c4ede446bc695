"""Unpack headers and library of the MuJoCo releases that a wheel has a plugin for.

Example:
    python .ci/mujoco_releases.py build/mujoco
    MECANUM_MUJOCO=build/mujoco python -m build --wheel

The releases are those under [tool.mecanum] in pyproject.toml. For another platform than this one, options of
`pip download` follow the folder: `--platform manylinux_2_28_aarch64`.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def releases() -> list[str]:
    """Return the supported releases of MuJoCo, such as "4.0.0", oldest first."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return list(settings["tool"]["mecanum"]["mujoco-releases"])


def unpack(release: str, out: Path, options: list[str]) -> None:
    """Download the wheel of a release and unpack its headers and library under `out`.

    `options` are further ones of `pip download`.
    """
    # From 4.0 on, headers and library are in a wheel of their own.
    name = "mujoco" if int(release.split(".")[0]) < 4 else "mujoco-core"
    folder = out / release
    if not list(folder.glob("mujoco/libmujoco*")):
        with tempfile.TemporaryDirectory() as downloads:
            pip = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--only-binary=:all:"]
            subprocess.run([*pip, "--dest", downloads, *options, f"{name}=={release}"], check=True)
            with zipfile.ZipFile(next(Path(downloads).glob("*.whl"))) as wheel:
                wanted = ("mujoco/include/", "mujoco/libmujoco")
                wheel.extractall(folder, [entry for entry in wheel.namelist() if entry.startswith(wanted)])


def main(out: Path, options: list[str]) -> None:
    """Unpack every release under `out`."""
    for release in releases():
        unpack(release, out, options)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
