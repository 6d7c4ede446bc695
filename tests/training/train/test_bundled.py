"""The policies that come with the package: small, with cards of their own, and as good as these say."""

import json

import numpy as np
import pytest

from mecanum_env.model import paper_model
from training.controllers.policy import Policy, bundled, load_policy
from training.evaluate import Setup, evaluate

FILES = sorted(bundled().parent.glob("*.npz"))
EPISODES = range(100_000, 100_080)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_its_card_is_of_this_very_file(path):
    policy = load_policy(path)
    card = json.loads(path.with_suffix(".json").read_text())
    assert card["about"] == policy.about
    text = path.with_suffix(".md").read_text()
    for row in card["rows"]:
        assert f"{row['policy']['successes'] / row['policy']['trials']:.3f}" in text
    assert path.stat().st_size < 200_000


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_it_wins_as_often_as_its_card_says(path):
    policy = load_policy(path)
    card = json.loads(path.with_suffix(".json").read_text())
    said = next(
        row["policy"] for row in card["rows"] if (row["physics"], row["difficulty"]) == ("planar", "normal")
    )
    played = evaluate(
        lambda *_: Policy(policy.network, policy.about), Setup(paper_model()), EPISODES
    ).episodes
    successes = sum(episode.success for episode in played)
    share = said["successes"] / said["trials"]
    # Four standard deviations of the number of successes, other episodes being others.
    spread = 4.0 * np.sqrt(len(EPISODES) * share * (1.0 - share))
    assert abs(successes - share * len(EPISODES)) <= max(spread, 3.0)
