"""The story on a robot in another process: its page, and on a small scale the whole of it."""

import contextlib
import importlib
import io
import json
from pathlib import Path

import pytest

from mecanum_env.model import read_model

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture(scope="module")
def script():
    """Return the example as a module, found as when it is run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(EXAMPLES)
        yield importlib.import_module("onto_a_robot")


@pytest.fixture
def told():
    """Return a story with two controllers."""
    timing = {"period_ms": 100.0, "jitter_ms": 2.0, "late_ms": 6.0, "late": 3.0, "commands": 500.0}
    shares = {"nominal": (0.2, 0.1, 0.3), "nominal+compensated": (0.7, 0.6, 0.8)}
    fights = {
        name: {
            "success": dict(zip(("value", "low", "high"), share, strict=True)),
            "gained": [0.5, 0.4, 0.6],
            "timing": timing,
            "count": 60,
        }
        for name, share in shares.items()
    }
    return {"fights": fights, "hidden": {"command_latency": {"delay_s": 0.1}}}


def test_the_page_has_the_figures_of_the_story(script, told, tmp_path, crossed_text):
    script.write_story_page(tmp_path / "story.html", told, "named: command_latency")
    assert crossed_text(tmp_path / "story.html", 390) == []
    page = (tmp_path / "story.html").read_text(encoding="utf-8")
    for words in ("0.70 (0.60 .. 0.80)", "+0.50 (+0.40 .. +0.60)", "3 of 500", "named: command_latency"):
        assert words in page


def test_the_story_does_not_look_into_the_robot():
    text = (EXAMPLES / "onto_a_robot.py").read_text(encoding="utf-8")
    assert "_HIDDEN" not in text
    assert "_BUILT" not in text


@pytest.mark.slow
def test_the_whole_story_ends_with_more_fights_won(script, tmp_path):
    words = io.StringIO()
    with contextlib.redirect_stdout(words), contextlib.redirect_stderr(io.StringIO()):
        script.onto_a_robot(tmp_path / "out", fights=30, jobs=1, quick=True)
    story = json.loads((tmp_path / "out" / "story.json").read_text(encoding="utf-8"))
    assert set(read_model(tmp_path / "out" / "gap" / "model.json").effects) == set(story["hidden"])
    assert story["fights"]["nominal+compensated"]["gained"][1] > 0.0
    steps = [line.split(".")[0] for line in words.getvalue().splitlines() if line[:1].isdigit()]
    assert steps == ["1", "2", "3", "4", "5"]
