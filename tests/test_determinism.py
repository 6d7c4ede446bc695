"""The same command writes the same bytes in every process, whatever the order of its sets."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LOGS = str(ROOT / "examples" / "logs")
TIMED = {"fit": ("fit.json", "report.html")}
"""Files that also say how long something took."""


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("fit", ["sysid.fit", LOGS, "--starts", "1", "--effects", "off"]),
        ("plan", ["sysid.logs", "plan", "--minutes", "12"]),
        ("mjcf", ["mecanum_env.mjcf"]),
    ],
)
def test_two_processes_write_the_same_bytes(name, arguments, tmp_path):
    written = []
    for seed in ("1", "2"):
        out = tmp_path / seed / name
        environment = os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": str(ROOT)}
        done = subprocess.run(
            [sys.executable, "-m", *arguments, "--out", str(out)],
            cwd=tmp_path, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        files = {p.relative_to(out).as_posix(): p.read_bytes() for p in out.rglob("*") if p.is_file()}
        manifest = json.loads(files.pop("mecanum-output.json"))
        for timed in TIMED.get(name, ()):
            files.pop(timed, None)
            manifest["files"].pop(timed, None)
        hashes = {file: entry["sha256"] for file, entry in manifest["files"].items()}
        written.append((files, hashes))
    assert written[0] == written[1]
