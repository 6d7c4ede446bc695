"""`benchmarks/peers.py` runs at small sizes, and its tables have a row for every contender."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
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


@pytest.mark.parametrize("part", ROWS)
def test_a_part_has_a_row_for_every_contender(part: str, tmp_path: Path) -> None:
    out, page = tmp_path / "peers.json", tmp_path / "peers.md"
    command = [sys.executable, str(ROOT / "benchmarks" / "peers.py"), "--only", part, "--quick"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    subprocess.run(
        [*command, "--out", str(out), "--markdown", str(page)], check=True, env=environment, cwd=tmp_path
    )
    written = json.loads(out.read_text(encoding="utf-8"))
    table = written["tables"][0]
    assert {row[0] for row in table["rows"]} == ROWS[part]
    assert all(len(row) == len(table["head"]) for row in table["rows"])
    assert all(f"| {name} |" in page.read_text(encoding="utf-8") for name in ROWS[part])
    assert "mujoco" in written["versions"]
