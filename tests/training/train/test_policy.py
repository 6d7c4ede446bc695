"""Policy files and the controllers that they make, with NumPy alone; the bundled ones and their cards."""

import itertools
import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.model import paper_model
from mecanum_env.tankendo.actions import action_to_command
from mecanum_env.tankendo.constants import GUARD_TIP_M
from mecanum_env.tankendo.sword import GUARD_HEIGHT_M
from training.controllers.features import EXTRA_FEATURES, FEATURE_NAMES, features, stack_features
from training.controllers.policy import Network, Policy, bundled, load_policy, save_policy
from training.evaluate import Setup, evaluate_controller

BUNDLED = sorted(bundled().parent.glob("*.npz"))
EPISODES = range(100_000, 100_080)


@pytest.fixture
def network():
    """Return a small network on two observations of twenty numbers."""
    rng = np.random.default_rng(0)
    sizes = [42, 7, 3]
    return Network(
        mean=rng.normal(size=42),
        scale=rng.uniform(0.5, 2.0, 42),
        clip=10.0,
        weights=tuple(
            rng.normal(size=(b, a)).astype(np.float32).astype(float) for a, b in itertools.pairwise(sizes)
        ),
        biases=tuple(rng.normal(size=b).astype(np.float32).astype(float) for b in sizes[1:]),
        activation="tanh",
        squashes=False,
        action_mode="cartesian",
        stack=2,
    )


def test_a_file_gives_back_what_was_saved(network, tmp_path):
    save_policy(tmp_path / "policy.npz", network, {"env": "MecanumTankendo-v0", "seed": 3})
    for path in (tmp_path, tmp_path / "policy.npz"):
        policy = load_policy(path)
        seen = np.random.default_rng(1).normal(size=(50, 42))
        np.testing.assert_array_equal(policy.network.actions(seen), network.actions(seen))
        assert policy.about["seed"] == 3


def test_it_acts_on_the_last_observations(network):
    policy = Policy(network, {})
    seen = np.random.default_rng(2).normal(size=(3, 20))
    commands = [policy.act(one) for one in seen]
    for command, (before, now) in zip(commands, [(0, 0), (0, 1), (1, 2)], strict=True):
        action = network.actions(np.concatenate([features(seen[before]), features(seen[now])]))
        np.testing.assert_array_equal(command, action_to_command(action, "cartesian"))
        assert all(isinstance(number, int) for number in command)
    policy.reset()
    assert policy.act(seen[0]) == commands[0]


def test_memory_of_many_is_that_of_each():
    seen = np.random.default_rng(3).normal(size=(4, 5, 20))
    together = None
    for step in seen:
        together = stack_features(together, step, 3)
    for row in range(5):
        alone = None
        for step in seen[:, row]:
            alone = stack_features(alone, step, 3)
        np.testing.assert_array_equal(together[row], alone)


def test_a_robot_needs_no_torch():
    program = (
        "import sys, numpy as np; from training.controllers.policy import bundled, load_policy; "
        "policy = load_policy(bundled()); print(policy.act(np.zeros(20))); "
        "assert not {'torch', 'stable_baselines3'} & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_file_says_whether_its_network_sees_the_time_to_the_cut(network, tmp_path):
    seeing = replace(network, mean=np.zeros(44), scale=np.ones(44), has_time_to_cut=True)
    seeing = replace(seeing, weights=(np.ones((7, 44)), *network.weights[1:]))
    save_policy(tmp_path / "policy.npz", seeing, {})
    assert load_policy(tmp_path / "policy.npz").network.has_time_to_cut
    assert load_policy(tmp_path / "policy.npz").network.observation_size == 20
    assert not load_policy(bundled("robust")).network.has_time_to_cut
    save_policy(tmp_path / "policy.npz", replace(seeing, has_time_to_cut=2), {})
    with pytest.raises(InputError, match="has_time_to_cut = 2, must be true or false"):
        load_policy(tmp_path / "policy.npz")


def test_an_observation_of_another_task_is_refused(network):
    policy = Policy(network, {"env": "MecanumTankendo-v0"})
    with pytest.raises(InputError, match=r"must be \(20,\): this policy was trained for MecanumTankendo-v0"):
        policy.act(np.zeros(23))


def test_what_is_no_policy_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such policy"):
        load_policy(tmp_path / "none.npz")
    with pytest.raises(InputError, match=r'bundled policy .nominl. \(did you mean "nominal"'):
        bundled("nominl")


def _torn(file):
    whole = bytearray(bundled().read_bytes())
    whole[400] ^= 255
    file.write(whole)


@pytest.mark.parametrize(
    "write",
    [
        lambda file: file.write(b"text"),
        lambda file: file.write(b""),
        lambda file: file.write(bundled().read_bytes()[:2000]),
        _torn,
        lambda file: np.save(file, np.zeros(3)),
        lambda file: np.savez(file, x=np.zeros(3)),
        lambda file: np.savez(file, about=np.array({"a": 1}, dtype=object)),
        lambda file: np.savez(file, about=np.array("{")),
        lambda file: np.savez(file, about=np.array("[1]")),
        lambda file: np.savez(file, about=np.array('{"format": "mecanum-policy/1"}')),
    ],
)
def test_a_foreign_or_torn_file_is_refused_in_our_words(write, tmp_path):
    with (tmp_path / "other.npz").open("wb") as file:
        write(file)
    with pytest.raises(InputError) as refusal:
        load_policy(tmp_path / "other.npz")
    said = str(refusal.value)
    assert said.startswith(f"{tmp_path / 'other.npz'}: no policy file, ")
    assert said.endswith("; give policy.npz of a folder that `python -m training.train` wrote")
    assert not any(word in said for word in ("pickle", "Error", "'about'"))


def test_layers_that_do_not_fit_are_refused(network, tmp_path):
    save_policy(tmp_path / "policy.npz", replace(network, weights=network.weights[::-1]), {})
    with pytest.raises(InputError, match="do not fit 42 inputs"):
        load_policy(tmp_path / "policy.npz")
    save_policy(tmp_path / "policy.npz", replace(network, mean=network.mean * np.nan), {})
    with pytest.raises(InputError, match="a number is not finite"):
        load_policy(tmp_path / "policy.npz")
    save_policy(tmp_path / "policy.npz", replace(network, activation="step"), {})
    with pytest.raises(InputError, match="activation = 'step'"):
        load_policy(tmp_path / "policy.npz")


def test_features_say_what_their_names_say():
    """The opponent 2 m ahead on guard, then its sword sunk and drawn back as for a thrust at the trunk."""
    seen = np.zeros(22)
    seen[[0, 2, 4, 6, 10]] = 2.0, 0.5, 2.0 - GUARD_TIP_M, GUARD_HEIGHT_M, 0.2
    seen[20:] = 1.0, 2.0
    named = dict(zip(FEATURE_NAMES, features(seen), strict=False))
    assert len(features(seen)) == len(seen) + EXTRA_FEATURES == len(FEATURE_NAMES) + 12
    np.testing.assert_array_equal(features(seen)[-2:], [1.0, 2.0])
    assert named["distance - maai"] == pytest.approx(2.0 - 2 * GUARD_TIP_M)
    assert named["opponent's relative velocity, ahead"] == pytest.approx(0.3)
    assert named["tip relative to the opponent, ahead"] == pytest.approx(-GUARD_TIP_M)
    assert named["tip's distance from guard"] == pytest.approx(0.0)
    seen[[4, 6]] = 2.0 - GUARD_TIP_M + 0.3, GUARD_HEIGHT_M - 0.4
    assert features(seen)[FEATURE_NAMES.index("tip's distance from guard")] == pytest.approx(0.5)


def test_features_of_many_are_those_of_each():
    seen = np.random.default_rng(4).normal(size=(5, 3, 20))
    for index in np.ndindex(5, 3):
        np.testing.assert_array_equal(features(seen)[index], features(seen[index]))


@pytest.mark.parametrize("path", BUNDLED, ids=lambda path: path.stem)
def test_its_card_is_of_this_very_file(path):
    policy = load_policy(path)
    card = json.loads(path.with_suffix(".json").read_text())
    assert card["about"] == policy.about
    text = path.with_suffix(".md").read_text()
    for row in card["rows"]:
        assert f"{row['policy']['successes'] / row['policy']['trials']:.3f}" in text
    assert path.stat().st_size < 200_000


@pytest.mark.parametrize("path", BUNDLED, ids=lambda path: path.stem)
def test_it_wins_as_often_as_its_card_says(path):
    policy = load_policy(path)
    card = json.loads(path.with_suffix(".json").read_text())
    said = next(
        row["policy"] for row in card["rows"] if (row["physics"], row["difficulty"]) == ("planar", "normal")
    )
    played = evaluate_controller(
        lambda *_: Policy(policy.network, policy.about), Setup(paper_model()), EPISODES
    ).episodes
    successes = sum(episode.success for episode in played)
    share = said["successes"] / said["trials"]
    # Four standard deviations of the number of successes, other episodes being others.
    spread = 4.0 * np.sqrt(len(EPISODES) * share * (1.0 - share))
    assert abs(successes - share * len(EPISODES)) <= max(spread, 3.0)
