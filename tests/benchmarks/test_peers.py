"""`benchmarks/peers.py` runs at small sizes, and its tables have a row for every contender."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

ROWS = {
    "fit": {"ours", "ours, law alone", "mujoco.sysid", "scipy output error", "SIPPY ARX"},
    "physics": {
        "ours, rollers",
        "ours, planar",
        "spheres, 8 a wheel",
        "spheres, 20 a wheel",
        "capsules, stiff contact",
        "capsules, default contact",
        "PickNik-like, 8 spheres",
        "PickNik-like, 20 spheres",
    },
    "throughput": {
        "ours: arrays",
        "ours: arrays, few robots",
        "ours: MuJoCo batch",
        "Gymnasium Sync over ours",
        "Gymnasium Async over ours",
        "Gymnasium Sync, HalfCheetah-v5",
    },
}


TITLES = {
    "fit": "## Identification: a wheel from its logs",
    "physics": "## Physics: a Mecanum robot on its wheels",
    "throughput": "## Throughput: environment steps a second",
}


@pytest.fixture(scope="module")
def peers(benchmark_of: Callable[[str], ModuleType]) -> ModuleType:
    return benchmark_of("peers")


@pytest.mark.parametrize("part", ROWS)
def test_a_part_has_a_row_for_every_contender_and_its_place_in_the_page(
    peers: ModuleType, part: str, tmp_path: Path
) -> None:
    out, page = tmp_path / "peers.json", tmp_path / "peers.md"
    before = "# Beside its peers\n\nCommit abc.\n\n"
    page.write_text(f"{before}{TITLES[part]}\n\nold\n\n## Another\n\nkept\n", encoding="utf-8")
    with warnings.catch_warnings():
        # What peers warn of is theirs.
        warnings.simplefilter("ignore")
        peers.main(only=part, quick=True, out=out, markdown=page)
    written = json.loads(out.read_text(encoding="utf-8"))
    table = written["tables"][0]
    assert {row[0] for row in table["rows"]} == ROWS[part]
    assert all(len(row) == len(table["head"]) for row in table["rows"])
    text = page.read_text(encoding="utf-8")
    assert text.startswith(f"{before}{TITLES[part]}\n\n*This part was measured apart. Commit ")
    assert "\n\n## Another\n\nkept\n" in text
    assert "old" not in text
    assert all(f"| {name} |" in text for name in ROWS[part])
    assert "mujoco" in written["versions"]
