"""The wheel drive as a native MuJoCo actuator plugin, "mecanum.wheel", and the rollers of the planar plant.

MuJoCo 4 calls `register` through the entry point `mujoco.plugins` during ``import mujoco`` and is then only
partly initialised, so this module imports nothing but the standard library and this project's errors.
MuJoCo 3 knows no such entry points: there `mecanum_env.plugin.layout` calls it, and a program of one's own
that only reads a written model must.
"""

from __future__ import annotations

import ctypes
import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from mecanum_env.errors import BackendError
from mecanum_env.version import __version__

PLUGIN_NAME: Final = "mecanum.wheel"
ROLLERS_PLUGIN: Final = "mecanum.rollers"

# Followed by the MuJoCo release that the library was compiled against; see CMakeLists.txt.
_STEM: Final = "mecanum_wheel-mujoco-"


def library_path(mujoco_version: str, folders: Iterable[str] | None = None) -> Path:
    """Return the path of the plugin's library for one MuJoCo release, such as ``"4.0.0"``.

    MuJoCo's structs differ between releases, so a library compiled for another one is refused before it is
    loaded, by the release in its name.

    Args:
        mujoco_version: the release that runs.
        folders: where to look; by default this package's own folders, then that of the installed package of
            the same version. They differ in a checkout whose files shadow an installed package.

    Raises:
        BackendError: there is no library, or only for another release.
    """
    chosen = [*__path__, *installed_folders()] if folders is None else folders
    searched = list(dict.fromkeys(Path(folder).resolve() for folder in chosen))
    found = sorted(library for folder in searched for library in folder.glob(f"{_STEM}*.so"))
    for library in found:
        if library.name == f"{_STEM}{mujoco_version}.so":
            return library
    if found:
        releases = [library.name.removeprefix(_STEM).removesuffix(".so") for library in found]
        built = ", ".join(dict.fromkeys(releases))
        raise BackendError(
            f"the wheel plugin was compiled for mujoco {built}, but mujoco {mujoco_version} runs; "
            f"install a release that it knows: `pip install mujoco=={releases[-1]}`; or compile the plugin "
            f"for the one that is there: {build_command()}"
        )
    raise BackendError(
        f"the wheel plugin's library {_STEM}{mujoco_version}.so is not in {' or '.join(map(str, searched))}; "
        f"compile it: {build_command()}"
    )


def build_command() -> str:
    """Return the command that compiles the plugin for the installed MuJoCo, and what it needs."""
    # Imported here, since it costs every `import mujoco` 10 ms.
    from mecanum_env.checkout import checkout

    if checkout():
        how = "`pip install --no-build-isolation .` in the checkout"
    else:
        sources = "--force-reinstall --no-deps --no-binary mecanum-tankendo"
        how = f"`pip install --no-build-isolation {sources} mecanum-tankendo`"
    return f"{how} (first `pip install scikit-build-core`, `apt-get install gcc libc6-dev`)"


def require_current(library: Path) -> None:
    """Refuse a library of other sources than those in this folder, whose numbers would mean something else.

    The MuJoCo library must be loaded. A library that was compiled by hand does not say what its sources were.

    Raises:
        BackendError: the library was compiled from other sources.
    """
    loaded = ctypes.CDLL(str(library))
    said = getattr(loaded, "mecanum_sources", None)
    if said is not None:
        said.restype = ctypes.c_char_p
    sources = "" if said is None else said().decode()
    if said is None or sources not in ("", sources_sha256()):
        raise BackendError(
            f"{library} was compiled from other sources; compile the plugin again: {build_command()}"
        )


def sources_sha256() -> str:
    """Return the hash of the plugin's sources in this folder, as CMakeLists.txt makes it."""
    texts = sorted(path for path in Path(__file__).parent.iterdir() if path.suffix in (".c", ".h"))
    hashes = "".join(hashlib.sha256(path.read_bytes()).hexdigest() for path in texts)
    return hashlib.sha256(hashes.encode()).hexdigest()


def installed_folders() -> list[str]:
    """Return the plugin folders of the installed packages on `sys.path` that have this package's version."""
    from importlib.metadata import distributions

    return [
        str(found.locate_file("mecanum_env/plugin"))
        for found in distributions(name="mecanum-tankendo")
        if found.version == __version__
    ]


def register_if_mujoco_did_not() -> None:
    """Call `register` under MuJoCo 3, which knows no entry points; `import mujoco` has done so under 4.

    Raises:
        BackendError: as for `register`.
    """
    import mujoco

    if int(mujoco.mj_versionString().split(".")[0]) < 4:
        register()


def register() -> None:
    """Load the plugin into the MuJoCo library that runs; a second call changes nothing.

    Raises:
        BackendError: there is no library for the MuJoCo release that runs, or it is of other sources. During
            ``import mujoco`` MuJoCo turns it into a RuntimeWarning.
    """
    import mujoco

    library = library_path(mujoco.mj_versionString())
    require_current(library)
    mujoco.mj_loadPluginLibrary(str(library))
