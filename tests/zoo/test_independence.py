"""What a study is judged by shares no code with what it judges."""

import ast
import sys
from pathlib import Path

import pytest

from sysid.studies.zoo import drives, robots

ALLOWED = sys.stdlib_module_names | {"numpy", "scipy", "numba"}


def imported(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        if isinstance(node, ast.ImportFrom):
            yield "." * node.level + (node.module or "")


@pytest.mark.parametrize(
    ("package", "own"), [(drives, "sysid.studies.zoo.drives."), (robots, "sysid.studies.zoo.")]
)
def test_drives_and_robots_import_nothing_of_the_package_that_they_judge(package, own):
    wrong = [
        f"{path.name}: {name}"
        for path in Path(package.__file__).parent.glob("*.py")
        for name in imported(path)
        if name.split(".")[0] not in ALLOWED and not f"{name}.".startswith(own)
    ]
    assert wrong == []
