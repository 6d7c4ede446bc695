"""The wheel drive as a native MuJoCo actuator plugin, "mecanum.wheel".

The entry point `mujoco.plugins` calls `register` during ``import mujoco``, which is then only partly
initialised; so this module imports nothing but the standard library and this project's errors.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Final

from mecanum_env.errors import BackendError

PLUGIN_NAME: Final = "mecanum.wheel"

# The MuJoCo release that it was compiled against follows; see CMakeLists.txt.
_STEM: Final = "mecanum_wheel-mujoco-"


def library_path(mujoco_version: str, folders: Iterable[str] | None = None) -> Path:
    """Return the path of the plugin's library for one MuJoCo release, such as ``"4.0.0"``.

    The library's name carries the release that it was compiled against, since MuJoCo's structs differ
    between releases; so the wrong one is refused before it is loaded.

    Args:
        mujoco_version: the release that runs.
        folders: where to look; by default this package's folders. In an editable install these are two:
            the checkout's, with the Python files, and the one in site-packages, with the library.

    Raises:
        BackendError: there is no library, or only for another release.
    """
    searched = [Path(folder) for folder in (__path__ if folders is None else folders)]
    found = sorted(library for folder in searched for library in folder.glob(f"{_STEM}*.so"))
    for library in found:
        if library.name == f"{_STEM}{mujoco_version}.so":
            return library
    if found:
        built = ", ".join(library.name.removeprefix(_STEM).removesuffix(".so") for library in found)
        raise BackendError(
            f"the wheel plugin was compiled for mujoco {built}, but mujoco {mujoco_version} runs; "
            "install that release, or reinstall mecanum-tankendo with `pip install .`, which builds it again"
        )
    raise BackendError(
        f"the wheel plugin's library {_STEM}{mujoco_version}.so is not in {' or '.join(map(str, searched))}; "
        "build it with `pip install .` (needs a C compiler: apt-get install gcc libc6-dev)"
    )


def register() -> None:
    """Load the plugin into the MuJoCo library that runs; a second call changes nothing.

    Raises:
        BackendError: there is no library for the MuJoCo release that runs. MuJoCo shows it as a
            RuntimeWarning when it happens during ``import mujoco``.
    """
    import mujoco

    mujoco.mj_loadPluginLibrary(str(library_path(mujoco.mj_versionString())))
