"""The commands and Python blocks of the documents, and how they are run."""

import contextlib
import importlib
import io
import re
import runpy
import shlex
import sys
import tomllib
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import mecanum_env

ROOT = Path(mecanum_env.__file__).parents[1]
PAGES = sorted(
    path
    for pattern in ("README.md", "CONTRIBUTING.md", "docs/*.md", "docs/howto/*.md", "docs/results/*.md")
    for path in ROOT.glob(pattern)
)
SCRIPTS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"].get("scripts", {})
PROGRAMS = ("python", ".venv/bin/python", "make", "pip", "pre-commit", "ray", "cd", *SCRIPTS)
"""First words of commands; a line of a shell block that starts with none of them is an error."""
NOT_RUN = re.compile(r"<!-- not run: (.+?) -->")
_SHELLS = ("sh", "bash", "console")


@dataclass(frozen=True)
class Block:
    """A block of commands or of Python in a document."""

    page: str
    line: int
    kind: str
    """"python" or "shell"."""
    text: str
    not_run: str
    """Why it is not run; empty: it is."""


def blocks(page: Path) -> Iterator[Block]:
    """Yield the blocks of a page: fences of a shell or of Python, and indented commands."""
    name, lines = str(page.relative_to(ROOT)), page.read_text(encoding="utf-8").splitlines()
    i, reason = 0, ""
    while i < len(lines):
        start, line = i, lines[i]
        if fence := re.match(r" *```(\w*)", line):
            end = next(k for k in range(i + 1, len(lines)) if lines[k].lstrip().startswith("```"))
            kind = {"python": "python", **dict.fromkeys(_SHELLS, "shell")}.get(fence[1], "")
            body, i = lines[i + 1 : end], end + 1
        elif line.startswith("    ") and line.split()[0] in PROGRAMS and (i == 0 or not lines[i - 1].strip()):
            while i < len(lines) and lines[i].startswith("    "):
                i += 1
            kind, body = "shell", lines[start:i]
        else:
            i += 1
            if line.strip():
                found = NOT_RUN.search(line)
                reason = found[1] if found else ""
            continue
        if kind:
            indent = min((len(row) - len(row.lstrip()) for row in body if row.strip()), default=0)
            yield Block(name, start + 1, kind, "\n".join(row[indent:] for row in body) + "\n", reason)
        reason = ""


def commands(block: Block) -> Iterator[list[str]]:
    """Yield the words of each command of a shell block, without comments, prompts and output.

    In a block with prompts only lines with a prompt are commands.
    """
    text = block.text.replace("\\\n", " ")
    prompts = any(line.startswith("$ ") for line in text.splitlines())
    for line in text.splitlines():
        if prompts and not line.startswith("$ "):
            continue
        words = shlex.split(line.removeprefix("$ "), comments=True)
        while words and re.fullmatch(r"[A-Z_]+=.*", words[0]):
            words = words[1:]
        if words:
            assert words[0] in PROGRAMS, f"{block.page}:{block.line}: {words[0]} is no known program"
            yield words


def call(words: list[str]) -> tuple[int, str]:
    """Run a Python program in this process; return its exit code and what it printed."""
    said, code = io.StringIO(), 0
    before, path = sys.argv, list(sys.path)
    try:
        with (
            contextlib.redirect_stdout(said),
            contextlib.redirect_stderr(said),
            warnings.catch_warnings(),
        ):
            warnings.filterwarnings("ignore", ".*found in sys.modules", RuntimeWarning)
            if words[0] in SCRIPTS:
                module, function = SCRIPTS[words[0]].split(":")
                sys.argv = words
                sys.exit(getattr(importlib.import_module(module), function)())
            if words[1] == "-m":
                sys.argv = words[2:]
                runpy.run_module(words[2], run_name="__main__", alter_sys=True)
            else:
                sys.argv = words[1:]
                # As Python does for a script, so that it finds the files beside it.
                sys.path.insert(0, str(Path(words[1]).resolve().parent))
                runpy.run_path(words[1], run_name="__main__")
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
        if isinstance(end.code, str):
            said.write(end.code)
    finally:
        sys.argv, sys.path[:] = before, path
    return code, said.getvalue()


@cache
def help_of(*words: str) -> str:
    """Return what a Python program says of itself."""
    code, said = call([*words, "--help"])
    assert code == 0 or "usage" in said.lower(), said
    return re.sub(r"[│╭╮╰╯─]", " ", said)


def unknown_options(words: list[str]) -> list[str]:
    """Return the options, extras and targets of a command that do not exist."""
    if words[0] == "make":
        targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
        return [word for word in words[1:] if "=" not in word and word not in targets]
    if words[0] == "pip":
        project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        extras = [
            name for found in re.findall(r"\[([\w,-]+)\]", " ".join(words)) for name in found.split(",")
        ]
        return [name for name in extras if name not in project["optional-dependencies"]]
    if words[0] in SCRIPTS:
        program, rest = words[:2], words[2:]
    elif words[0].endswith("python") and words[1] == "-m":
        program, rest = ["python", *words[1:3]], words[3:]
    elif words[0].endswith("python"):
        program, rest = ["python", words[1]], words[2:]
    else:
        return []
    ours = ("mecanum_env", "mecanum_cli", "sysid", "training", "examples", "benchmarks")
    if words[0] not in SCRIPTS and not program[-1].startswith(ours):
        return []
    while rest and re.search(rf"[{{,]{re.escape(rest[0])}[,}}]", help_of(*program)):
        program, rest = [*program, rest[0]], rest[1:]
    said = help_of(*program)
    options = [word.strip("[]").split("=")[0] for word in rest if word.strip("[").startswith("--")]
    return [option for option in options if not re.search(rf"(?<![\w-]){option}(?![\w-])", said)]
