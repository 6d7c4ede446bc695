"""Where the blind tests are: beside the package in a checkout, in no installation."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import cast

import sysid
from mecanum_env.errors import InputError
from sysid.blind.case import BlindTests


def blind_tests() -> BlindTests:
    """Return the makers of blind tests of this checkout.

    Raises:
        InputError: the program runs from an installation, which has none.
    """
    tests = Path(sysid.__file__).parents[1] / "tests"
    if not (tests / "blind" / "__init__.py").is_file():
        raise InputError(
            f"{tests / 'blind'}: no such folder; blind tests come with a checkout of the repository, "
            "run them there"
        )
    if str(tests) not in sys.path:
        sys.path.append(str(tests))
    return cast(BlindTests, importlib.import_module("blind"))
