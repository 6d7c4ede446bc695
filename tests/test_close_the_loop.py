"""The end-to-end example, on a small scale: what it hides is found, what it predicts comes true."""

import contextlib
import importlib
import io
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from mecanum_env.model import paper_model, read_model
from training.certify.certificate import read_certificate
from training.certify.plants import HELD_OUT
from training.certify.variations import certificate_variants
from training.evaluate import share

EXAMPLES = Path(__file__).parents[1] / "examples"
SCRIPTS = ("close_the_loop", "loop_report", "hidden_robot")


@pytest.fixture(scope="module")
def scripts():
    """Return the example's files as modules, found as when `close_the_loop.py` is run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(EXAMPLES)
        yield SimpleNamespace(**{name: importlib.import_module(name) for name in SCRIPTS})


def few_variants(*given):
    """Return the plants of a certificate with only one of those that are held out."""
    found = certificate_variants(*given)
    held_out = [one for one in found if one.group == HELD_OUT]
    return tuple(one for one in found if one not in held_out[1:])


def few_fights(on_the_robot):
    """Return what plays all fights of controllers of this story, and only some of those that go along."""

    def play(controllers, scale):
        asked = {n: scale if n.startswith("retreat") else replace(scale, episodes=4) for n in controllers}
        return tuple(on_the_robot({n: controllers[n]}, asked[n])[0] for n in controllers)

    return play


@pytest.fixture(scope="module")
def told(scripts, tmp_path_factory):
    """Return the folder, the figures and the words of one small run."""
    out = tmp_path_factory.mktemp("loop")
    words = io.StringIO()
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stdout(words),
        contextlib.redirect_stderr(io.StringIO()),
    ):
        # No figure of the story is of the plants that a certificate holds apart, or of many warnings.
        patch.setattr("training.certify.run.certificate_variants", few_variants)
        patch.setattr("training.certify.run.WARNING_FACTOR", 1)
        loop = scripts.close_the_loop
        patch.setattr(loop, "on_the_robot", few_fights(loop.on_the_robot))
        scripts.close_the_loop.close_the_loop(out, "retreat", episodes=60, jobs=1, quick=True)
    figures = json.loads((out / "loop.json").read_text(encoding="utf-8"))
    return SimpleNamespace(out=out, figures=figures, words=words.getvalue())


def test_what_is_hidden_is_named_and_its_intervals_hold_the_truth(told):
    gap, hidden = told.figures["gap"], told.figures["hidden"]
    assert gap["verdict"] == "named"
    assert {found["name"] for found in gap["effects"]} == set(hidden)
    for found in gap["effects"]:
        for name, interval in found["parameters"].items():
            assert interval["low"] <= hidden[found["name"]][name] <= interval["high"]
    assert gap["before"] > 10.0 * gap["after"]
    assert set(read_model(told.out / "gap" / "model.json").effects) == set(hidden)


def test_the_improved_model_predicts_the_drop_and_the_fit_does_not(told):
    predictions = told.figures["predictions"]
    assert not predictions["drop, by the fit"]["holds"]
    assert predictions["drop, by the improved model"]["holds"]
    assert predictions["compensated, by the improved model"]["holds"]


def test_compensation_is_better_on_the_robot_itself(told):
    _, low, _ = told.figures["gained"]["retreat+compensated"]
    assert low > 0.0, told.figures["gained"]


def test_the_figures_are_those_of_the_certificates(told):
    of = {(row["controller"], row["robot"]): row["value"] for row in told.figures["fights"]}
    first = read_certificate(told.out / "certificate" / "certificate.json")
    second = read_certificate(told.out / "certificate_improved" / "certificate.json")
    assert of["retreat", "fit"] == first.nominal.success.value
    assert of["retreat+compensated", "improved model"] == second.nominal.success.value
    assert first.provenance["model_sha256"] != second.provenance["model_sha256"]


def test_the_story_has_its_eight_steps_and_its_pictures(told):
    starts = [line.split(".")[0] for line in told.words.splitlines() if line[:1].isdigit()]
    assert starts == [str(step) for step in range(1, 9)]
    for name in ("gap", "success", "warning"):
        picture = (told.out / f"close_the_loop_{name}.png").read_bytes()
        assert picture.startswith(b"\x89PNG")
        assert len(picture) > 5000


def test_the_page_has_the_predictions_and_what_is_gained(told):
    page = (told.out / "loop.html").read_text(encoding="utf-8")
    for one in told.figures["predictions"].values():
        assert f"<td>{one['predicted']:.2f}</td><td>{one['measured']:.2f}</td>" in page
    for name in told.figures["gained"]:
        assert f"<td>{name}</td>" in page


def test_the_story_does_not_look_into_the_robot(scripts):
    for name in ("close_the_loop", "loop_report"):
        text = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8")
        assert "_HIDDEN" not in text
        assert "_BUILT" not in text
    known = paper_model()
    assert scripts.hidden_robot.fights("still", known, 1, "planar").setup.model is known


def test_the_robot_fights_other_fights_than_a_certificate_and_moves_otherwise(scripts):
    played = scripts.hidden_robot.fights("retreat", paper_model(), 2, "planar").play()
    assert [episode.seed for episode in played.episodes] == [20_000, 20_001]
    (fit_speed, robot_speed) = (
        sum(episode.speed_error_m_s for episode in evaluation.episodes)
        for evaluation in (_on_the_fit("retreat", range(20_000, 20_002)), played)
    )
    assert robot_speed > 1.2 * fit_speed


def test_the_interval_of_a_difference_is_newcombes(scripts):
    # R. G. Newcombe 1998, table II: 56/70 against 48/80, method 10.
    found = scripts.loop_report.difference(share(48, 80), share(56, 70))
    assert found == pytest.approx((0.2, 0.0524, 0.3339), abs=5e-5)


def _on_the_fit(controller, seeds):
    from training.evaluate import Setup, controller_factory, evaluate_controller

    return evaluate_controller(controller_factory(controller, paper_model()), Setup(paper_model()), seeds)
