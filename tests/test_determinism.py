"""The same commands write the same bytes in every process, whatever the order of its sets."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LOGS = ("random_hold_a", "random_hold_b", "step_020", "step_060", "step_100")
COMMANDS = {
    "fit": ["fit", "../logs", "--starts", "1", "--effects", "off"],
    "plan": ["logs", "plan", "--minutes", "12"],
    "mjcf": ["mjcf"],
}
TIMED = {"fit": ("fit.json", "report.html")}
"""Files that also say how long something took."""


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Return two folders in which all commands wrote, each in a process of its own."""
    folders = []
    whole = tmp_path_factory.mktemp("all")
    (whole / "logs").mkdir()
    for name in LOGS:
        shutil.copy(ROOT / "examples" / "logs" / f"{name}_1.csv", whole / "logs")
    for seed in ("1", "2"):
        folder = whole / seed
        folder.mkdir()
        given = [[*words, "--out", name] for name, words in COMMANDS.items()]
        program = f"from mecanum_cli.__main__ import main\nassert not any([main(one) for one in {given!r}])"
        environment = os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": str(ROOT)}
        done = subprocess.run(
            [sys.executable, "-c", program],
            cwd=folder, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        folders.append(folder)
    return folders


@pytest.mark.parametrize("name", COMMANDS)
def test_two_processes_write_the_same_bytes(name, written):
    found = []
    for folder in written:
        out = folder / name
        files = {p.relative_to(out).as_posix(): p.read_bytes() for p in out.rglob("*") if p.is_file()}
        manifest = json.loads(files.pop("mecanum-output.json"))
        for timed in TIMED.get(name, ()):
            files.pop(timed)
            manifest["files"].pop(timed)
        hashes = {file: entry["sha256"] for file, entry in manifest["files"].items()}
        found.append((files, hashes))
    assert found[0] == found[1]
