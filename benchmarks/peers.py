"""Identification, physics and throughput by this project and by its peers, in one run.

The peers are what a user would pick instead: mujoco.sysid, a plain scipy output error and SIPPY; Mecanum
robots as others model them in MuJoCo, written anew from their descriptions; Gymnasium's vector environments.

    python benchmarks/peers.py --markdown docs/results/peers.md --out out/bench/peers.json

`pip install "mecanum-tankendo[peers]"` brings the peers of the fit; a method that is not installed has a row
that says so. With MECANUM_REAL_LOGS recordings of real wheels are fitted, too.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final, Literal, get_args

from contenders import fit, physics, throughput
from contenders.table import Table

from mecanum_env.checkout import commit
from mecanum_env.cli import run
from mecanum_env.files import write_json, write_text
from mecanum_env.markdown import markdown_table

Part = Literal["physics", "throughput", "fit"]
PACKAGES: Final = ("mujoco", "gymnasium", "numpy", "scipy", "sippy-unipi")


def main(
    only: Part | None = None,
    repeats: int = 5,
    fit_rounds: int = 1,
    drives: int = 3,
    first_seed: int = 0,
    quick: bool = False,
    out: Path | None = None,
    markdown: Path | None = None,
) -> None:
    """Measure all parts and print their tables; files are written after each part.

    Args:
        only: measure this part alone.
        repeats: rounds of the measurements of speed.
        fit_rounds: rounds of the fits, which take most of the time and differ more between logs.
        drives: how many drives of the zoo are identified.
        first_seed: development seed of the first of them.
        quick: small sizes, which show that all works and measure little.
        out: JSON file to write.
        markdown: page to write; with `only`, this part of a page that exists is written anew, and says so.
    """
    parts: dict[Part, Callable[[], list[Table]]] = {
        "physics": lambda: [_physics(repeats, quick)],
        "throughput": lambda: [_throughput(repeats, quick)],
        "fit": lambda: fit.measure(1 if quick else fit_rounds, _logs(drives, first_seed, quick)),
    }
    code = commit() or "unknown"
    machine = f"{platform.machine()}, {os.cpu_count()} processors, Python {platform.python_version()}"
    versions = {name: _version(name) for name in PACKAGES}
    tables: list[Table] = []
    for part in get_args(Part):
        if only not in (None, part):
            continue
        tables += parts[part]()
        if out is not None:
            found = [table.json() for table in tables]
            write_json(out, {"commit": code, "machine": machine, "versions": versions, "tables": found})
        if markdown is not None:
            where = f"Commit {code[:12]}; {machine}"
            if only is not None and markdown.exists():
                page = _with_parts(markdown.read_text(encoding="utf-8"), tables, where, versions)
            else:
                page = _page(tables, f"{where}.", versions)
            write_text(markdown, page)
    print("\n\n".join(table.markdown() for table in tables))


def _logs(drives: int, first_seed: int, quick: bool) -> dict[str, Any]:
    if quick:
        return fit.few()
    return {**fit.bundled(), **fit.drawn(drives, first_seed), **fit.real()}


def _physics(repeats: int, quick: bool) -> Table:
    if quick:
        return physics.measure(physics.Sizes(1, 0.5, 0.2, (1 / 120,), 1 / 480))
    return physics.measure(physics.Sizes(repeats))


def _throughput(repeats: int, quick: bool) -> Table:
    if quick:
        return throughput.measure(1, many=16, few=2, steps=2, workers=1)
    return throughput.measure(repeats, many=4096, few=16, steps=30, workers=4)


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def _page(tables: list[Table], where: str, versions: dict[str, str]) -> str:
    head = (
        "# Beside its peers\n\n"
        "The same work by this project and by what a user would pick instead, measured in one run by\n"
        "`python benchmarks/peers.py --markdown docs/results/peers.md` (`--out FILE` writes all rounds).\n"
        "Where ours loses, a line below the table says so.\n\n"
        f"{where}\n\n"
    )
    used = markdown_table(tuple(versions), [tuple(versions.values())])
    return head + used + "\n\n" + "\n\n".join(table.markdown() for table in tables) + "\n"


def _with_parts(page: str, tables: list[Table], where: str, versions: dict[str, str]) -> str:
    """Return a page whose sections of these tables are new, and say where they were measured."""
    used = ", ".join(f"{name} {release}" for name, release in versions.items())
    sections = [section.strip() for section in page.split("\n## ")]
    titles = [section.partition("\n")[0] for section in sections]
    for table in tables:
        title, _, rest = table.markdown().removeprefix("## ").partition("\n\n")
        text = f"{title}\n\n*This part was measured apart. {where}; {used}.*\n\n{rest}"
        if title in titles:
            sections[titles.index(title)] = text
        else:
            sections.append(text)
    return "\n\n## ".join(sections) + "\n"


if __name__ == "__main__":
    raise SystemExit(run(main, prog="python benchmarks/peers.py"))
