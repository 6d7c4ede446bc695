"""Cards and curves show the results of episodes and runs."""

import json
from dataclasses import asdict

import pytest

pytest.importorskip("stable_baselines3")

from mecanum_env.cli import run
from mecanum_env.model import paper_model
from training.controllers.policy import Policy, load_policy
from training.evaluate import Setup, evaluate_controller
from training.train import card, curve
from training.train.checkpoint import Point
from training.train.run import train_policy
from training.train.settings import Ppo, TrainingSettings


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with a policy that is hardly trained."""
    folder = tmp_path_factory.mktemp("card") / "run"
    ppo = Ppo(rollout_steps=8, batch_size=32, epochs=1, layers=(8,))
    settings = TrainingSettings(steps=64, envs=4, stack=2, ppo=ppo, reward_weights={"hit": 2.0})
    train_policy(settings, folder, development_seeds=range(100_000, 100_002), quiet=True)
    return folder


def test_a_card_says_what_was_measured(folder, tmp_path, capsys):
    out = tmp_path / "card.md"
    command = [str(folder), "--out", str(out), "--episodes", "6", "--rollers-episodes", "1"]
    assert run(card.main, command) == 0
    capsys.readouterr()
    text, stored = out.read_text(), json.loads(out.with_suffix(".json").read_text())
    planar = [row for row in stored["rows"] if row["physics"] == "planar" and row["robot"] == "nominal"]
    assert [row["difficulty"] for row in planar] == ["easy", "normal", "hard"]
    policy = load_policy(folder)
    setup = Setup(paper_model(), difficulty="easy")
    played = evaluate_controller(lambda *_: Policy(policy.network, policy.about), setup, range(6)).episodes
    assert planar[0]["policy"]["successes"] == sum(episode.success for episode in played)
    assert f"| nominal | planar | easy | {planar[0]['policy']['successes'] / 6:.3f} (" in text
    assert "PPO, seed 0, 64 steps" in text
    assert "the best of 1 checkpoints up to 64 steps" in text
    assert "hit 2.0" in text
    assert "worst" in text.lower()


def test_a_card_says_what_the_commands_of_its_policy_do_not(folder):
    policy = load_policy(folder)
    rows = card.measure(policy, paper_model(), 1, 0, lambda: None)
    assert "history" not in card.card("one", policy, rows, "command")
    told = Policy(policy.network, {**policy.about, "history": "Stopped once."})
    assert "| history | Stopped once. |" in card.card("one", told, rows, "command")


def test_a_card_without_episodes_is_refused(folder, capsys):
    assert run(card.main, [str(folder), "--episodes", "0"]) == 2
    assert "episodes = 0, must be at least 1" in capsys.readouterr().err


def test_a_curve_is_drawn_from_what_was_watched(folder, tmp_path):
    points = [Point(**point) for point in json.loads((folder / "curve.json").read_text())]
    assert curve.read_curve(folder) == points
    runs = {name: TrainingSettings(seed=seed) for name, seed in (("one", 0), ("two", 1))}
    assert curve.by_seed(runs) == {"one": ["one", "two"]}
    alone = runs | {"two": TrainingSettings(seed=1, stack=6)}
    groups = curve.by_seed(alone)
    assert groups == {"one": ["one"], "two": ["two"]}
    figure = curve.draw({"one": points, "two": points}, groups, 0.5, ["one"])
    retreat, success, worst, _ = figure.axes[0].lines
    assert list(retreat.get_ydata()) == [0.5, 0.5]
    assert list(success.get_ydata()) == [point.success for point in points]
    assert list(worst.get_ydata()) == [asdict(point)["worst"] for point in points]
    figure.draw_without_rendering()
    assert not figure.axes[0].texts, "a label among the curves is crossed by them"
    assert figure.legends[0].get_window_extent().y1 < figure.axes[0].get_window_extent().y0
    assert run(curve.main, [str(folder), "--out", str(tmp_path / "curve.png")]) == 0
    assert (tmp_path / "curve.png").read_bytes()[:4] == b"\x89PNG"


def test_a_folder_without_a_curve_is_refused(tmp_path, capsys):
    assert run(curve.main, [str(tmp_path)]) == 2
    assert "give the folder of `python -m training.train`" in capsys.readouterr().err
    assert run(curve.main, []) == 2
