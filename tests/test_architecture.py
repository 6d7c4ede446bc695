"""The shape of the code: which room may import which, light imports, file sizes, documented arguments."""

import ast
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import mecanum_env

# The checkout, or site-packages where the tests run against a built wheel.
ROOT = Path(mecanum_env.__file__).parent.parent
PACKAGES = ("mecanum_env", "sysid", "training", "mecanum_cli")
FILES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
MAY_IMPORT = {
    "mecanum_env": {"mecanum_env"},
    "sysid": {"sysid", "mecanum_env"},
    "training": {"training", "mecanum_env"},
    # On top of all: it runs every program, each imported only when it is asked for.
    "mecanum_cli": {"mecanum_cli", "training", "sysid", "mecanum_env"},
}
LONGEST_FILE = 400
OBVIOUS = {"name", "value", "seconds"}
UNITS = {"rpm", "deg", "rad", "hz", "s", "m", "n", "kg", "m2", "v", "ms", "px", "s2", "s3", "volts"}


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in FILES}
IS_PACKAGE = {name for name, path in MODULES.items() if path.name == "__init__.py"}


# At import every worker of the suite would parse them all, and one of them runs these tests.
@cache
def trees() -> dict[str, ast.Module]:
    """Return what each module says."""
    found = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in MODULES.items()}
    # The stub of a package lists what it imports on demand (`lazy_loader`).
    for name, path in MODULES.items():
        if (stub := path.with_suffix(".pyi")).exists():
            found[name].body += ast.parse(stub.read_text(encoding="utf-8")).body
    return found


def imports_of(name: str, nodes) -> set[str]:
    """Return the modules of this project that the statements import; names of a package become modules."""
    found = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parts = name.split(".") if name in IS_PACKAGE else name.split(".")[:-1]
                parts = parts[: len(parts) - node.level + 1]
                base = ".".join([*parts, base] if base else parts)
            for alias in node.names:
                submodule = f"{base}.{alias.name}"
                found.add(submodule if submodule in MODULES else base)
    return {module for module in found if module.split(".")[0] in PACKAGES}


@cache
def imports() -> dict[str, set[str]]:
    """Return every import of every module: at import time, inside functions, and for type checkers alone."""
    return {name: imports_of(name, ast.walk(tree)) - {name} for name, tree in trees().items()}


ROOMS = {
    "mecanum_env": (
        "parallel",
        "law",
        "wheel_drive",
        "model",
        "effects",
        "plugin",
        "mjcf",
        "simulator",
        "batch",
        "rendering",
        "view",
        "senses",
        "tankendo",
    ),
    "sysid": ("logs", "compare", "fit", "gap", "studies"),
    "sysid.compare": (
        "measured",
        "links",
        "predicted",
        "noise",
        "search_space",
        "model_error",
        "least_squares",
    ),
    "sysid.fit": ("estimators", "options", "statistics", "drive", "effects", "robot", "pipeline", "report"),
    "sysid.gap": ("search", "link_faults", "design", "report", "workflow"),
    "training": ("controllers", "evaluate", "certify", "compare", "export", "drivers", "run"),
}
"""The rooms of each package, from the ground floor up: a room imports only rooms before it."""


WITH_DOORS = (
    *(f"sysid.compare.{room}" for room in ROOMS["sysid.compare"]),
    *(f"sysid.fit.{room}" for room in ("drive", "effects", "robot", "report")),
)
"""Rooms that show what is for others in their `__init__`."""


def circles(needs: dict[str, set[str]]) -> dict[str, set[str]]:
    """Return the part of a graph of imports that contains circles; empty where every arrow points one way."""
    waiting = {name: needed & needs.keys() - {name} for name, needed in needs.items()}
    while free := {name for name, needed in waiting.items() if not needed & waiting.keys()}:
        waiting = {name: needed & waiting.keys() for name, needed in waiting.items() if name not in free}
    # What only leads into a circle from above is no part of it.
    while top := {name for name in waiting if not any(name in needed for needed in waiting.values())}:
        waiting = {name: needed for name, needed in waiting.items() if name not in top}
    return waiting


def children(package: str) -> dict[str, set[str]]:
    """Return the files and folders directly inside a package, each with those of them that it imports."""
    depth = package.count(".") + 1

    def child(module: str) -> str | None:
        inside = module.startswith(f"{package}.")
        return module.split(".")[depth] if inside else None

    needs: dict[str, set[str]] = {}
    for module, imported in imports().items():
        if own := child(module):
            needs.setdefault(own, set()).update(filter(None, map(child, imported)))
    return needs


def test_arrows_between_packages_point_one_way():
    wrong = [
        f"{name} imports {module}"
        for name, modules in imports().items()
        for module in modules
        if module.split(".")[0] not in MAY_IMPORT[name.split(".")[0]]
    ]
    assert wrong == []


def test_no_files_import_each_other_in_a_circle():
    assert circles(imports()) == {}


@pytest.mark.parametrize("package", sorted(IS_PACKAGE))
def test_no_folders_import_each_other_in_a_circle(package):
    assert circles(children(package)) == {}


@pytest.mark.parametrize("package", sorted(ROOMS))
def test_a_room_imports_only_rooms_below_it(package):
    floors = ROOMS[package]
    needs = children(package)
    wrong = [
        f"{package}.{room} imports {package}.{other}"
        for floor, room in enumerate(floors)
        for other in floors[floor + 1 :]
        if other in needs[room]
    ]
    assert wrong == []


def test_fit_and_gap_share_only_what_lies_below_both():
    """`fit` imports nothing of `gap`; `gap` sees no more of `fit` than its door."""
    of_gap = {m for n, modules in imports().items() if n.startswith("sysid.fit") for m in modules}
    assert {module for module in of_gap if module.startswith("sysid.gap")} == set()
    of_fit = {m for n, modules in imports().items() if n.startswith("sysid.gap") for m in modules}
    assert {module for module in of_fit if module.startswith("sysid.fit.")} == set()


@pytest.mark.parametrize("room", WITH_DOORS)
def test_a_room_is_entered_by_its_door(room):
    wrong = [
        f"{name} imports {module}"
        for name, modules in imports().items()
        for module in modules
        if module.startswith(f"{room}.") and not f"{name}.".startswith(f"{room}.")
    ]
    assert wrong == []


MAPPED = ("mecanum_env", "sysid", "sysid.compare", "sysid.fit", "sysid.gap")


def rooms_on_the_map(package: str) -> list[str]:
    """Return the rooms in the table of a package in CONTRIBUTING.md, in their order."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    table = text[text.index(f"\n`{package}`: ") :].split("\n|---|---|\n")[1].split("\n\n")[0]
    return re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)


@pytest.mark.skipif(not (ROOT / "CONTRIBUTING.md").exists(), reason="tests run against a built wheel")
@pytest.mark.parametrize("package", MAPPED)
def test_the_map_shows_every_room_above_those_that_import_it(package):
    rooms, needs = rooms_on_the_map(package), children(package)
    folders = {path.name for path in (ROOT / package.replace(".", "/")).iterdir() if path.is_dir()}
    # The template of pages is no room, but one of the files beside them.
    assert (folders & needs.keys()) - {"report"} <= {*rooms}
    assert [room for room in rooms if room not in needs] == []
    wrong = [
        f"{room} imports {other}"
        for floor, room in enumerate(rooms)
        for other in rooms[floor + 1 :]
        if other in needs[room]
    ]
    assert wrong == []


@pytest.mark.parametrize("package", sorted(IS_PACKAGE))
def test_the_list_of_a_room_names_its_files(package):
    """A room that lists its files lists no others, and names each of them, if only beside another one."""
    text = (ROOT / package.replace(".", "/") / "__init__.py").read_text(encoding="utf-8")
    doc = ast.get_docstring(ast.parse(text)) or ""
    rows = [row.split(", ") for row in re.findall(r"^ *(\w+(?:, \w+)*)  +\S", doc, re.MULTILINE)]
    listed = {name for row in rows for name in row}
    files = {name for name in children(package) if name not in ("__init__", "__main__")}
    if len(rows) < 2:
        return
    assert listed - files == set()
    unnamed = files - listed - {*re.findall(r"`(\w+)`", doc)}
    assert unnamed == set()


def test_a_circle_of_imports_is_found():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}}) == {"b": {"c"}, "c": {"b"}}
    assert circles({"a": {"b"}, "b": {"c"}, "c": set()}) == {}


@pytest.mark.parametrize("module", ["mecanum_env", "mecanum_env.plugin"])
def test_what_mujoco_loads_at_import_stays_light(module):
    program = f"import sys, {module}; print(*sorted(m for m in sys.modules if '.' not in m))"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT
    )
    heavy = {"mujoco", "gymnasium", "scipy", "matplotlib", "imageio", "tyro", "numpy"}
    assert set(done.stdout.split()) & heavy == set()


def test_files_stay_short():
    sources = [
        path
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if path.suffix in (".py", ".c", ".h")
    ]
    lengths = {
        str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines()) for path in sources
    }
    assert {name: n for name, n in lengths.items() if n > LONGEST_FILE} == {}


def public_definitions(tree: ast.Module):
    """Yield (qualified name, node) of public functions, classes and methods."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            yield node.name, node
            # A protocol's members are documented where they are implemented.
            if isinstance(node, ast.ClassDef) and "Protocol" not in [ast.unparse(b) for b in node.bases]:
                for inner in node.body:
                    if isinstance(inner, ast.FunctionDef) and not inner.name.startswith("_"):
                        yield f"{node.name}.{inner.name}", inner


@cache
def own_classes() -> set[str]:
    """Return the names of all classes of the packages."""
    return {node.name for tree in trees().values() for node in tree.body if isinstance(node, ast.ClassDef)}


def explains_itself(name: str, annotation: ast.expr | None) -> bool:
    """Return whether name and type say all: a quantity with its unit, a class documented itself."""
    quantity = "_" in name and name.split("_")[-1] in UNITS
    words = set(re.findall(r"\w+", ast.unparse(annotation))) if annotation else set()
    own = words & (own_classes() | {"Path", "PathLike", "Generator"})
    return name in OBVIOUS or quantity or bool(own) or any(word.startswith("Mj") for word in words)


def is_mentioned(name: str, text: str) -> bool:
    """Return whether a name, or every word of it that is not a unit, begins a word of the text."""
    if name == "abc":  # the law's coefficients are written A, B, C in formulae
        return "A, B, C" in text or name in text
    words = [w for w in re.findall(r"[a-z0-9]+", name.lower()) if w not in UNITS] or [name.lower()]
    text = text.lower()
    return all(re.search(rf"\b{re.escape(w.rstrip('s') or w)}", text.replace("_", " ")) for w in words)


def undocumented(tree: ast.Module) -> list[str]:
    """List public definitions without a docstring, and arguments that it does not mention."""
    bad = []
    for name, node in public_definitions(tree):
        text = ast.get_docstring(node) or ""
        if not text:
            bad.append(name)
        if isinstance(node, ast.FunctionDef):
            arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            bad += [
                f"{name}({argument.arg})"
                for argument in arguments
                if argument.arg not in ("self", "cls")
                and not argument.arg.startswith("_")
                and not explains_itself(argument.arg, argument.annotation)
                and not is_mentioned(argument.arg, text)
            ]
    return bad


@pytest.mark.parametrize("module", sorted(MODULES))
def test_public_code_says_what_its_arguments_are(module):
    assert ast.get_docstring(trees()[module])
    assert undocumented(trees()[module]) == []


def test_the_documentation_rule_can_fail():
    tree = ast.parse(
        'def f(speed_rpm, limit, top_speed, model: Model, spec: MjSpec):\n    "Clip to the top SPEEDS."\n'
        "class Point:\n    pass\n"
    )
    assert undocumented(tree) == ["f(limit)", "Point"]
