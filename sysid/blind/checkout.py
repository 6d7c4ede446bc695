"""Where the blind tests are: beside the package in a checkout, in no installation."""

from __future__ import annotations

import hashlib
import importlib
import sys
from pathlib import Path
from typing import cast

import mecanum_env
import sysid
from mecanum_env.errors import InputError
from sysid.blind.case import BlindTests


def fingerprint() -> str:
    """Return twelve letters that change with any source that an outcome may hang on."""
    package = Path(sysid.__file__).parent
    folders = (package, Path(mecanum_env.__file__).parent, _folder() / "blind")
    digest = hashlib.sha256()
    for folder in folders:
        for path in sorted(p for p in folder.rglob("*") if p.suffix in (".py", ".c", ".h", ".json")):
            digest.update(str(path.relative_to(folder)).encode() + path.read_bytes())
    return digest.hexdigest()[:12]


def blind_tests() -> BlindTests:
    """Return the makers of blind tests, of this checkout or of the current folder.

    Raises:
        InputError: the program runs from an installation, which has none.
    """
    tests = str(_folder())
    if tests not in sys.path:
        sys.path.append(tests)
    return cast(BlindTests, importlib.import_module("blind"))


def _folder() -> Path:
    # The second is for tests that run against an installation, from a copy of the test folder.
    roots = (Path(sysid.__file__).parents[1], Path.cwd())
    folders = [root / "tests" for root in roots if (root / "tests" / "blind" / "__init__.py").is_file()]
    if not folders:
        raise InputError(
            f"{roots[0] / 'tests' / 'blind'}: no such folder; blind tests come with a checkout of the "
            "repository, run them there"
        )
    return folders[0]
