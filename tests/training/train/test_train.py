"""Training: exact after an interruption, whole folders, bad input; the exported policy is the learner's."""

import base64
import contextlib
import io
import json
import pickle
import shutil
import zipfile
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from mecanum_env.errors import InputError
from mecanum_env.outputs import lock_folder, output_folder
from tests import crash
from training.controllers.policy import load_network, load_policy
from training.train import checkpoint
from training.train.agent import make_agent, network_of
from training.train.checkpoint import (
    Point,
    Run,
    best_point,
    export_best,
    load_weights,
    newest_checkpoint,
    read_learner,
    read_run,
    read_state,
    write_checkpoint,
)
from training.train.environments import training_env
from training.train.run import resume, train_policy
from training.train.settings import Ppo, Sac, TrainingSettings, command_line, settings_from_json

WATCH = range(100_000, 100_002)
SMALL = {
    "ppo": TrainingSettings(
        steps=384,
        envs=4,
        stack=2,
        checkpoint_every=128,
        ppo=Ppo(rollout_steps=16, batch_size=32, epochs=2, layers=(8,)),
    ),
    "sac": TrainingSettings(
        algo="sac",
        steps=384,
        envs=4,
        stack=2,
        checkpoint_every=128,
        sac=Sac(learning_starts=64, batch_size=16, updates_a_step=1, buffer_size=400, layers=(8,)),
    ),
}


@pytest.fixture(scope="module", params=SMALL)
def trained(request, tmp_path_factory):
    """Return settings and folder of an uninterrupted run."""
    folder = tmp_path_factory.mktemp(request.param) / "run"
    settings = SMALL[request.param]
    train_policy(settings, folder, development_seeds=WATCH, quiet=True)
    return settings, folder


def learner(folder, settings):
    return read_learner(newest_checkpoint(folder), settings)


def test_an_interrupted_run_ends_with_the_same_weights(trained, tmp_path):
    settings, folder = trained
    other = tmp_path / "run"
    first = train_policy(settings, other, stop_after=100, development_seeds=WATCH, quiet=True)
    assert 100 <= first.steps_done < settings.steps
    last = resume(other, development_seeds=WATCH, quiet=True)
    assert last.steps_done == settings.steps
    (agent, normaliser), (again, normaliser_again) = learner(folder, settings), learner(other, settings)
    weights, weights_again = agent.policy.state_dict(), again.policy.state_dict()
    assert weights.keys() == weights_again.keys()
    assert all(np.array_equal(weights[name].numpy(), weights_again[name].numpy()) for name in weights)
    np.testing.assert_array_equal(normaliser.obs_rms.mean, normaliser_again.obs_rms.mean)
    np.testing.assert_array_equal(normaliser.obs_rms.var, normaliser_again.obs_rms.var)
    assert normaliser.ret_rms.var == normaliser_again.ret_rms.var


def test_another_seed_ends_with_other_weights(trained, tmp_path):
    settings, folder = trained
    train_policy(replace(settings, seed=1), tmp_path / "run", development_seeds=WATCH, quiet=True)
    one, other = load_policy(folder / "policy.npz"), load_policy(tmp_path / "run" / "policy.npz")
    assert not np.array_equal(one.network.weights[-1], other.network.weights[-1])


def test_the_exported_policy_is_the_learners(trained):
    settings, folder = trained
    agent, normaliser = learner(folder, settings)
    network = load_policy(newest_checkpoint(folder) / "policy.npz").network
    rng = np.random.default_rng(0)
    size = normaliser.observation_space.shape[0]
    seen = np.concatenate([rng.uniform(-15, 15, (100, size)), rng.normal(size=(100, size))])
    expected, _ = agent.predict(normaliser.normalize_obs(seen), deterministic=True)
    np.testing.assert_allclose(network.actions(seen), expected, atol=1e-5)


def test_a_folder_says_what_made_it(trained):
    settings, folder = trained
    stored, facts = read_run(folder)
    assert stored == settings
    assert {"python", "mujoco", "torch", "stable-baselines3"} <= facts["versions"].keys()
    about = load_policy(folder / "policy.npz").about
    assert about["chosen"]["newest_steps"] == settings.steps
    assert settings_from_json(about["settings"]) == settings
    curve = json.loads((folder / "curve.json").read_text())
    assert [point["steps"] for point in curve] == [128, 256, 384]
    assert list((folder / "tensorboard").iterdir())
    assert not list(folder.rglob(".*"))


def test_the_exported_policy_is_that_of_the_best_checkpoint(trained, tmp_path):
    _, folder = trained
    run_folder, newest = copy_of(folder, tmp_path / "run")
    state = json.loads((newest / "state.json").read_text())
    for point, success in zip(state["curve"], (0.2, 0.7, 0.5), strict=True):
        point["success"] = success
    (newest / "state.json").write_text(json.dumps(state))
    export_best(run_folder)
    network, about = load_network(run_folder)
    best, _ = load_network(newest.with_name("000000256"))
    assert about["steps_done"] == 256
    assert about["chosen"] == {"of": 3, "success": 0.7, "newest_steps": 384}
    for weights, wanted in zip(network.weights, best.weights, strict=True):
        np.testing.assert_array_equal(weights, wanted)


def test_of_equal_checkpoints_the_newest_that_is_left_is_exported():
    points = [Point(steps, success, success, 0.0, 0.0) for steps, success in ((1, 0.9), (2, 0.5), (3, 0.5))]
    assert best_point(points, ["000000002", "000000003"]).steps == 3


def test_only_the_newest_checkpoint_keeps_the_replay_buffer(trained):
    settings, folder = trained
    kept = [path.parent.name for path in folder.glob("checkpoints/*/replay.npz")]
    assert kept == (["000000384"] if settings.algo == "sac" else [])


def test_a_half_written_checkpoint_is_not_taken(trained, tmp_path):
    _, folder = trained
    shutil.copytree(folder, tmp_path / "run")
    torn = tmp_path / "run" / "checkpoints" / ".mecanum-staged-abc"
    torn.mkdir()
    assert newest_checkpoint(tmp_path / "run").name == "000000384"


def test_what_is_over_or_begun_is_refused(trained, tmp_path):
    settings, folder = trained
    with pytest.raises(InputError, match="already trained for 384 steps; give more with --steps"):
        resume(folder, quiet=True)
    with pytest.raises(InputError, match="already trained for 384 steps"):
        resume(folder, steps=100, quiet=True)
    assert read_run(folder)[0] == settings
    with pytest.raises(InputError, match=r"holds a training run; continue it with --resume"):
        train_policy(settings, folder, quiet=True)
    with pytest.raises(InputError, match=r"run.json: cannot be read \(No such file"):
        resume(tmp_path, quiet=True)


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"settings": 5}', "\xff", '{"settings": {"ppo": {}}}'])
def test_a_folder_of_another_program_is_refused_in_our_words(text, tmp_path):
    (tmp_path / "run.json").write_text(text, encoding="latin-1")
    with pytest.raises(InputError) as refusal:
        read_run(tmp_path)
    said = str(refusal.value)
    assert said.startswith(f"{tmp_path / 'run.json'}")
    assert "Error" not in said
    assert "not " in said


def test_a_run_can_load_weights_the_weights_of_another(trained, tmp_path):
    settings, folder = trained
    normaliser = training_env(settings)
    agent = make_agent(replace(settings, seed=5), normaliser)
    load_weights(folder, agent, normaliser)
    own, other = network_of(agent, normaliser, settings), load_policy(folder).network
    seen = np.random.default_rng(0).normal(size=(20, len(own.mean)))
    np.testing.assert_array_equal(own.mean, other.mean)
    np.testing.assert_allclose(own.actions(seen), other.actions(seen), atol=1e-12)
    with pytest.raises(InputError, match="no checkpoint yet"):
        train_policy(replace(settings, start=str(tmp_path)), tmp_path / "run", quiet=True)
    wider = replace(settings, stack=3, start=str(folder))
    with pytest.raises(InputError, match="with this algorithm, network, stack and task"):
        train_policy(wider, tmp_path / "run", quiet=True)
    assert not (tmp_path / "run").exists()


def test_a_run_names_the_runs_that_it_began_with(trained, tmp_path):
    settings, folder = trained
    second = tmp_path / "second"
    train_policy(replace(settings, start=str(folder), steps=64), second, development_seeds=WATCH, quiet=True)
    first, own = load_policy(second).about["commands"]
    assert first == command_line(settings, str(folder))
    assert own == command_line(replace(settings, start=str(folder), steps=64), str(second))


def test_the_spread_is_renewed_at_its_checkpoint_and_not_before(tmp_path):
    torch = pytest.importorskip("torch")
    usual = SMALL["ppo"]
    never = replace(usual, ppo=replace(usual.ppo, renewed_at=1.0))
    train_policy(usual, tmp_path / "usual", development_seeds=WATCH, quiet=True)
    train_policy(never, tmp_path / "never", development_seeds=WATCH, quiet=True)
    for name, same in (("000000128", True), ("000000256", True), ("000000384", False)):
        one, other = (load_policy(tmp_path / run / "checkpoints" / name) for run in ("usual", "never"))
        assert np.array_equal(one.network.weights[-1], other.network.weights[-1]) == same
    agent, _ = learner(tmp_path / "usual", usual)
    agent.policy.reset_std(-1.5)
    distribution = agent.policy.get_distribution(torch.zeros(5, len(one.network.mean)))
    np.testing.assert_allclose(distribution.distribution.stddev.detach().numpy(), np.exp(-1.5), rtol=1e-6)


class Payload:
    """Runs code when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (type(self.path).touch, (self.path,))


def copy_of(folder, target):
    shutil.copytree(folder, target)
    return target, newest_checkpoint(target)


def test_a_checkpoint_is_read_without_running_code_of_it(trained, tmp_path):
    settings, folder = trained
    run_folder, newest = copy_of(folder, tmp_path / "run")
    sign = tmp_path / "code ran"
    bomb = pickle.dumps(Payload(sign))
    assert not [path for path in folder.rglob("*") if path.suffix in (".pkl", ".pickle")]
    tensors = io.BytesIO()
    with zipfile.ZipFile(tensors, "w") as archive:
        archive.writestr("data", json.dumps({":serialized:": base64.b64encode(bomb).decode()}))
        for name in zipfile.ZipFile(newest / "agent.zip").namelist():
            archive.writestr(name, bomb)
    files = {"agent.zip": tensors.getvalue(), "normaliser.pkl": bomb, "replay.pkl": bomb}
    files |= dict.fromkeys(("normaliser.npz", "replay.npz", "policy.npz", "state.json"), bomb)
    for name, data in {"agent.zip": bomb, **files}.items():
        (newest / name).write_bytes(data)
        with contextlib.suppress(InputError):
            resume(run_folder, steps=settings.steps + 64, development_seeds=WATCH, quiet=True)
        with contextlib.suppress(InputError):
            load_weights(run_folder, make_agent(settings, env := training_env(settings)), env)
        assert not sign.exists()
        shutil.rmtree(run_folder)
        copy_of(folder, run_folder)


@pytest.mark.parametrize("name", ["agent.zip", "normaliser.npz", "state.json", "policy.npz"])
def test_a_torn_checkpoint_is_refused_in_one_sentence(trained, tmp_path, name):
    settings, folder = trained
    run_folder, newest = copy_of(folder, tmp_path / "run")
    whole = (newest / name).read_bytes()
    for torn in (b"", whole[: len(whole) // 2], b"x" * len(whole), None):
        if torn is None:
            (newest / name).unlink()
        else:
            (newest / name).write_bytes(torn)
        with pytest.raises(InputError) as refusal:
            resume(run_folder, steps=settings.steps + 64, development_seeds=WATCH, quiet=True)
        assert str(newest) in str(refusal.value)
        assert "\n" not in str(refusal.value)


def test_a_run_killed_after_its_last_checkpoint_exports_it_when_resumed(trained, tmp_path):
    _, folder = trained
    run_folder, newest = copy_of(folder, tmp_path / "run")
    older = sorted((run_folder / "checkpoints").iterdir())[0]
    for name in ("policy.npz", "curve.json"):
        (run_folder / name).unlink()
    shutil.rmtree(older.with_name("000000384"))
    shutil.copytree(folder / "checkpoints" / "000000384", newest)
    with output_folder(run_folder, "training.train") as staged:
        (staged / "policy.npz").write_bytes((older / "policy.npz").read_bytes())
    with pytest.raises(InputError, match="already trained for 384 steps"):
        resume(run_folder, quiet=True)
    assert (run_folder / "policy.npz").read_bytes() == (folder / "policy.npz").read_bytes()
    assert (run_folder / "curve.json").read_bytes() == (folder / "curve.json").read_bytes()


def test_every_crash_of_a_checkpoint_is_mended_by_the_next_resume(trained, tmp_path, monkeypatch):
    settings, folder = trained
    facts = load_policy(folder).about
    monkeypatch.setattr(checkpoint, "about", lambda _, steps, __: facts | {"steps_done": steps})
    run_folder = tmp_path / "run"

    copy_of(folder, run_folder)
    state = read_state(newest_checkpoint(run_folder))
    shutil.rmtree(newest_checkpoint(run_folder))
    export_best(run_folder)
    agent, normaliser = learner(folder, settings)

    def work():
        write_checkpoint(Run(settings, run_folder, ["train"], agent, normaliser, state))

    def check(at):
        export_best(run_folder)
        steps = load_policy(run_folder).about["chosen"]["newest_steps"]
        assert steps == read_state(newest_checkpoint(run_folder)).steps_done, at
        assert len(json.loads((run_folder / "curve.json").read_text())) == steps // 128
        seen.add(steps)

    seen = set()
    assert crash.crash_everywhere(work, check, run_folder) > 20
    assert seen == {256, 384}


def test_two_trainings_of_one_folder_are_refused(trained, tmp_path):
    settings, folder = trained
    run_folder, _ = copy_of(folder, tmp_path / "run")
    with lock_folder(run_folder), pytest.raises(InputError, match="another command is writing there"):
        resume(run_folder, steps=settings.steps + 64, quiet=True)
