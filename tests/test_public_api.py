"""The names that users import: they exist, are listed in docs/api.md, and cost nothing until used.

`python tests/test_public_api.py` writes docs/api.md anew.
"""

import ast
import importlib
import inspect
import itertools
import re
import subprocess
import sys
from pathlib import Path

import pytest

import mecanum_env

ROOT = Path(mecanum_env.__file__).parents[1]
PAGE = Path(__file__).parents[1] / "docs" / "api.md"
DOORS = ("mecanum_env", "sysid", "sysid.gap", "training")
PACKAGES = ("mecanum_env", "sysid", "training")
HEAVY = ("scipy.signal", "matplotlib", "mujoco", "torch")
PROGRAMS = sorted(
    [
        *("mecanum_env.render", "sysid.studies.zoo.calibrate", "training.run.simulated_robot"),
        *(
            ".".join(path.parent.relative_to(ROOT).parts)
            for package in PACKAGES
            for path in (ROOT / package).rglob("__main__.py")
        ),
    ]
)
LAZY_PACKAGES = sorted(
    ".".join(path.parent.relative_to(ROOT).parts)
    for package in PACKAGES
    for path in (ROOT / package).rglob("__init__.pyi")
)


def exported_names(package: str) -> dict[str, str]:
    """Return public name -> the module that the stub of a package imports it from."""
    stub = Path(str(importlib.import_module(package).__file__)).with_suffix(".pyi")
    return {
        alias.name: f"{package}.{node.module}"
        for node in ast.parse(stub.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


HELP = """
import runpy, sys
for call in {calls!r}:
    name, *arguments = call.split()
    sys.argv[1:] = [*arguments, "--help"]
    try:
        runpy.run_module(name, run_name="__main__")
    except SystemExit as end:
        print(call, "exits with", end.code, file=sys.stderr)
    print(call, [m for m in {heavy!r} if m in sys.modules], file=sys.stderr)
"""


def said_by(code: str) -> list[str]:
    """Return the lines that a fresh interpreter writes to stderr when it runs the code."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    return done.stderr.splitlines()


def test_help_does_not_wait_for_the_library():
    """One interpreter for all programs: from the first that loads a heavy module on, each line names it."""
    calls = [*PROGRAMS, "sysid.logs check", "sysid.logs import"]
    expected = [line for call in calls for line in (f"{call} exits with 0", f"{call} []")]
    assert said_by(HELP.format(calls=calls, heavy=HEAVY)) == expected


def test_importing_the_packages_imports_no_library():
    modules = (*HEAVY, "numpy", "scipy", "gymnasium")
    ask = f"print(*[m for m in {modules!r} if m in sys.modules], file=sys.stderr)"
    assert said_by(f"import sys, {', '.join(DOORS)}; {ask}") == [""]


@pytest.mark.parametrize("package", LAZY_PACKAGES)
def test_a_package_offers_what_it_lists(package):
    module = importlib.import_module(package)
    lazy = exported_names(package)
    assert sorted(lazy) == sorted(module.__all__)
    assert set(lazy) <= set(dir(module))
    # Importing a submodule would put it in the place of the name.
    assert [name for name in lazy if importlib.util.find_spec(f"{package}.{name}")] == []


def test_a_name_that_does_not_exist_is_an_attribute_error():
    with pytest.raises(AttributeError, match="mecanum_env attribute read_modle"):
        mecanum_env.read_modle  # noqa: B018


@pytest.mark.parametrize("package", DOORS)
def test_every_public_name_can_be_imported_and_is_documented(package):
    if package == "training":
        pytest.importorskip("stable_baselines3")
    for name, sentence in sentences(package).items():
        assert getattr(importlib.import_module(package), name) is not None
        assert sentence.endswith("."), name


def test_docs_list_the_public_names():
    pytest.importorskip("stable_baselines3")
    assert PAGE.read_text(encoding="utf-8") == api_page(), "run: python tests/test_public_api.py"


def test_gymnasium_finds_the_environments_without_an_import(tmp_path):
    code = (
        "import gymnasium; env = gymnasium.make('mecanum_env:MecanumTankendo-v0'); env.reset(seed=1); "
        "many = gymnasium.make_vec('mecanum_env:MecanumTankendoDuel-v0', num_envs=2); "
        "print(env.spec.id, many.num_envs)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    assert done.stdout.split() == ["MecanumTankendo-v0", "2"]


def test_every_public_name_of_the_plant_needs_no_extra():
    code = "import sys; sys.modules['pettingzoo'] = None\nfrom mecanum_env import *"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_type_checkers_find_the_types():
    assert [package for package in PACKAGES if not (ROOT / package / "py.typed").exists()] == []


def sentences(package: str) -> dict[str, str]:
    """Return public name -> first sentence of its documentation."""
    module = importlib.import_module(package)
    homes = exported_names(package)
    return {name: first_sentence(documentation(homes[name], name)) for name in sorted(module.__all__)}


def documentation(module: str, name: str) -> str:
    value = getattr(importlib.import_module(module), name)
    if inspect.isclass(value) or inspect.isfunction(value):
        return inspect.cleandoc(value.__doc__ or "")
    # A constant is documented by the string below it.
    source = Path(str(importlib.import_module(module).__file__)).read_text(encoding="utf-8")
    body = ast.parse(source).body
    for line, below in itertools.pairwise(body):
        if (
            isinstance(line, ast.AnnAssign)
            and ast.unparse(line.target) == name
            and isinstance(below, ast.Expr)
        ):
            return str(ast.literal_eval(below.value))
    return ""


def first_sentence(text: str) -> str:
    paragraph = " ".join(text.split("\n\n")[0].split())
    found = re.match(r".+?\.(?= [A-Z`\"]|$)", paragraph)
    return found.group() if found else paragraph


def api_page() -> str:
    lines = [
        "# Public names",
        "",
        "What your own programs should import; everything else may move. Each name is loaded on first use,",
        "so importing a package takes no time. `help(NAME)` has the arguments, units and errors.",
    ]
    for package in DOORS:
        lines += ["", f"## `{package}`", "", "| name | |", "|---|---|"]
        lines += [
            f"| `{name}` | {text.replace('|', '&#124;')} |" for name, text in sentences(package).items()
        ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(api_page(), encoding="utf-8")
