"""Cases of GapBench from recordings of real machines: pairs of before and after, with what was changed."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from mecanum_env.errors import InputError
from mecanum_env.model import effect_named
from sysid.logs import read_dataset
from sysid.studies.gapbench.case_folder import CHANNEL, Material

PAIRS: Final = "pairs.toml"
_PACKAGED: Final = Path(__file__).parent / "recordings"


def real_cases(folder: Path) -> Iterator[Material]:
    """Yield a case for each pair of recordings in a folder, named after the folder and numbered from 0.

    The pairs stand in `pairs.toml` of the folder, or, for a recording that the package knows by the folder's
    name, in the package. Runs of the test split become the hidden test runs.

    Raises:
        InputError: no such file, a pair without a key that it needs, or logs that cannot be used.
    """
    path = next((p for p in (folder / PAIRS, _PACKAGED / f"{folder.name}.toml") if p.is_file()), None)
    if path is None:
        known = ", ".join(sorted(p.stem for p in _PACKAGED.glob("*.toml")))
        raise InputError(
            f"{folder}: has no {PAIRS}, and is none of the known recordings ({known}); write one: see "
            "docs/gapbench.md"
        )
    try:
        read = tomllib.loads(path.read_text(encoding="utf-8"))
        source, pairs = read["source"], read["pairs"]
    except (KeyError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{path}: not a list of pairs ({error}); see docs/gapbench.md") from error
    for index, pair in enumerate(pairs):
        yield _real_case(folder, f"{folder.name}_{index:02d}", source, pair)


def _real_case(folder: Path, name: str, source: str, pair: Mapping[str, Any]) -> Material:
    nominal, changed = (read_dataset(folder / pair[part]) for part in ("nominal", "changed"))
    test = tuple(run for run in changed.runs if run.split == "test" and CHANNEL in run.channels)
    kept = tuple(run for run in changed.runs if run.split != "test")
    return Material(
        name=name,
        nominal=replace(nominal, name="before the change"),
        changed=replace(changed, name="after the change", runs=kept),
        test=test,
        command_period_s=None,
        truth={
            "level": "bench",
            "kind": "single" if len(pair["hidden"]) == 1 else "pair" if pair["hidden"] else "quiet",
            "hidden": [_hidden(one) for one in pair["hidden"]],
            "outsider": "",
            "twins": [],
            "signal": None,
            "recording": f"{pair['nominal']} -> {pair['changed']}",
        },
        floor_rpm=None,
        source=source,
    )


def _hidden(name: str) -> dict[str, Any]:
    return {
        "name": name,
        "form": "",
        "effect": effect_named(name, None),
        "parameters": {},
        "neutral": {},
        "signal": None,
    }
