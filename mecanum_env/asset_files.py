"""Where the packaged files are: `assets/` in a checkout, `mecanum_env/assets` in an installed wheel."""

from __future__ import annotations

from pathlib import Path

from mecanum_env.errors import BackendError


def asset_path(name: str = "") -> Path:
    """Return the path of a packaged file or folder such as ``"models/paper.json"`` or ``"robot.xml"``.

    Raises:
        BackendError: this installation has no such file.
    """
    package = Path(__file__).parent
    # An editable install runs from the checkout, where the files lie beside the package, not inside.
    for root in (package / "assets", package.parent / "assets"):
        if (root / name).exists():
            return root / name
    raise BackendError(f"packaged file {name!r} not found; reinstall with `pip install .`")
