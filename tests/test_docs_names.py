"""The modules, files and commands that documents and docstrings name exist."""

import ast
import importlib
import importlib.util
import re
from pathlib import Path

import pytest

import mecanum_env

ROOT = Path(mecanum_env.__file__).parents[1]
DOCUMENTS = sorted(
    path
    for pattern in ("*.md", "docs/*.md", "mecanum_env/**/*.py", "sysid/**/*.py", "training/**/*.py")
    for path in ROOT.glob(pattern)
    if path.name != "CHANGELOG.md"
)
PUBLIC = ("mecanum_env", "sysid", "sysid.gap", "training", "mecanum_env.tankendo.duel")
"""Packages whose names documents may import. The duel needs an extra, so `mecanum_env` does not name it."""
PATHS = re.compile(
    r"(?<![\w/.])(?:mecanum_env|sysid|training|tests|benchmarks|examples|docs|assets)/[\w/.-]+\.(?:py|c|md|json|toml|csv)\b"
)
MODULES = re.compile(r"(?:`|python -m )((?:mecanum_env|sysid|training)(?:\.(?!md\b)\w+)+)")


def exists(name: str) -> bool:
    """Return whether a dotted name is a module, or an attribute of one."""
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        try:
            spec = importlib.util.find_spec(".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        if spec is not None:
            source = Path(spec.origin).read_text(encoding="utf-8") if spec.origin else ""
            stub = Path(spec.origin).with_suffix(".pyi") if spec.origin else None
            if stub is not None and stub.exists():
                source += stub.read_text(encoding="utf-8")
            return count == len(parts) or re.search(rf"\b{parts[count]}\b", source) is not None
    return False


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_what_a_document_names_exists(document):
    text = document.read_text(encoding="utf-8")
    missing = [path for path in set(PATHS.findall(text)) if not (ROOT / path).exists()]
    missing += [name for name in set(MODULES.findall(text)) if not exists(name)]
    assert sorted(missing) == []


@pytest.mark.parametrize(
    "document", [path for path in DOCUMENTS if path.suffix == ".md"], ids=lambda path: path.name
)
def test_the_imports_of_python_examples_work(document):
    blocks = re.findall(r"```python\n(.*?)```", document.read_text(encoding="utf-8"), re.DOTALL)
    imports = [
        node for block in blocks for node in ast.walk(ast.parse(block)) if isinstance(node, ast.ImportFrom)
    ]
    for node in imports:
        own = str(node.module).split(".")[0] in ("mecanum_env", "sysid", "training")
        assert not own or node.module in PUBLIC, "documents use the public names of docs/api.md only"
        module = importlib.import_module(str(node.module))
        assert [alias.name for alias in node.names if not hasattr(module, alias.name)] == []
