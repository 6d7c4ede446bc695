"""The folder works without this project: the page's method with numpy alone, the scorer with nothing."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import mecanum_env
from sysid.studies import score
from sysid.studies.gapbench.bench import FOLDER

ROOT = Path(mecanum_env.__file__).parents[1]
PAGE = ROOT / "docs/gapbench.md"


def alone(script: Path, *arguments: Path, modules: Path | None = None) -> str:
    """Run a script with the standard library, and the modules of one folder, as all that can be imported."""
    path = [] if modules is None else [str(modules)]
    program = (
        f"import runpy, sys; sys.path += {path!r}; sys.argv = {[str(script), *map(str, arguments)]!r}; "
        f"runpy.run_path({str(script)!r}, run_name='__main__')"
    )
    command = [sys.executable, "-I", "-S", "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=script.parent)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def numpy_only(tmp_path: Path) -> Path:
    """A folder in which numpy is the only package."""
    folder = tmp_path / "modules"
    folder.mkdir()
    installed = Path(np.__file__).parent
    for path in (installed, installed.with_name("numpy.libs")):
        if path.exists():
            (folder / path.name).symlink_to(path)
    return folder


@pytest.mark.skipif(not PAGE.exists(), reason="the documents are not installed")
def test_the_pages_method_and_the_scorer_need_nothing_of_ours(bench: Path, numpy_only: Path):
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    script = bench / "from_the_page.py"
    script.write_text(code, encoding="utf-8")
    alone(script, bench / "cases", bench / "answers/toy", modules=numpy_only)
    said = json.loads((bench / "answers/toy/answers.json").read_text(encoding="utf-8"))["cases"]
    assert said["case_001"]["verdict"] == "no_gap"
    assert said["case_000"]["candidates"] == [["speed_gain"], ["sensor_scale"]]
    printed = alone(bench / "score.py", bench / "answers/toy")
    assert re.search(r"rightly ambiguous +2", printed)
    assert re.search(r"right answers +100 %", printed)


@pytest.mark.skipif(not PAGE.exists(), reason="the documents are not installed")
def test_the_page_has_the_folders_example_and_the_scorers_words():
    page = PAGE.read_text(encoding="utf-8")
    assert (FOLDER / "example_adapter.py").read_text(encoding="utf-8") in page
    assert all(f"- **{word}**: {meaning}." in page for word, meaning in score.WORDS.items())


def test_the_folder_explains_itself(made: Path):
    text = (made / "README.md").read_text(encoding="utf-8")
    names = json.loads((made / "names.json").read_text(encoding="utf-8"))["effects"]
    assert "@" not in text
    assert all(f"| {entry['name']} | {entry['form']} |" in text and entry["equation"] for entry in names)


def test_a_method_sees_no_truth(made: Path):
    for path in (made / "cases").rglob("*"):
        if path.is_file():
            text = path.read_text(encoding="utf-8")
            assert "hidden" not in text
            assert "speed_gain" not in text
    assert "speed_rpm" not in (made / "cases/case_000/test/test_00.csv").read_text(encoding="utf-8")
