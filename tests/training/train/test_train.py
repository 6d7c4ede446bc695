"""Training: exact after an interruption, whole folders, bad input; the exported policy is the learner's."""

import base64
import contextlib
import importlib.util
import io
import json
import pickle
import shutil
import zipfile
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.model import paper_model
from mecanum_env.outputs import lock_folder, output_folder
from mecanum_env.senses import VariedSenses
from mecanum_env.tankendo import Opponents
from training.controllers.policy import load_policy
from training.train import checkpoint
from training.train.__main__ import main
from training.train.agent import make_agent, network_of
from training.train.checkpoint import (
    Run,
    State,
    export_newest,
    load_weights,
    newest_checkpoint,
    read_learner,
    read_run,
    read_state,
    write_checkpoint,
)
from training.train.environments import bare_env, episode_seeds, level_models, training_env
from training.train.run import DEVELOPMENT_SEEDS, resume, train_policy
from training.train.settings import Ppo, Sac, TrainingSettings, command_line, settings_from_json

_SPEC = importlib.util.spec_from_file_location("crash", Path(__file__).parents[2] / "crash.py")
crash = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(crash)

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
    network = load_policy(folder / "policy.npz").network
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
    assert about["steps_done"] == settings.steps
    assert settings_from_json(about["settings"]) == settings
    curve = json.loads((folder / "curve.json").read_text())
    assert [point["steps"] for point in curve] == [128, 256, 384]
    assert list((folder / "tensorboard").iterdir())
    assert not list(folder.rglob(".*"))


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


def test_bad_settings_are_refused(capsys):
    with pytest.raises(InputError, match=r'env = .*did you mean "MecanumTankendoDuel-v0"'):
        TrainingSettings(env="MecanumTankendoDual-v0")
    with pytest.raises(InputError, match="stack = 0, must be at least 1"):
        TrainingSettings(stack=0)
    with pytest.raises(InputError, match=r'no .stak. \(did you mean "stack"'):
        settings_from_json(asdict(TrainingSettings()) | {"stak": 1})
    assert run(main, []) == 2
    assert "--out FOLDER or --resume FOLDER" in capsys.readouterr().err
    assert run(main, ["--resume", "x", "--seed", "3"]) == 2
    assert "the run's own settings count" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--ppo.learning-rate", "-1"), "ppo.learning_rate = -1.0, must be a finite number of at least 0"),
        (("--ppo.last-learning-rate", "inf"), "ppo.last_learning_rate = inf, must be a finite number"),
        (("--ppo.batch-size", "0"), "ppo.batch_size = 0, must be at least 2"),
        (("--ppo.rollout-steps", "0"), "ppo.rollout_steps = 0, must be at least 1"),
        (("--ppo.rollout-steps", "1", "--envs", "1"), "a rollout must have at least 2 steps"),
        (("--ppo.layers", "8", "-3"), "ppo.layers = -3, must be at least 1"),
        (("--ppo.epochs", "-1"), "ppo.epochs = -1, must be at least 1"),
        (("--ppo.gamma", "2"), "ppo.gamma = 2.0, must be a number from 0 to 1"),
        (("--ppo.clip-range", "-1"), "ppo.clip_range = -1.0, must be a finite number of at least 0"),
        (("--ppo.log-std", "nan"), "ppo.log_std = nan, must be a finite number"),
        (("--sac.learning-rate", "nan"), "sac.learning_rate = nan, must be a finite number"),
        (("--sac.updates-a-step", "0"), "sac.updates_a_step = 0, must be at least 1"),
        (("--sac.buffer-size", "-1"), "sac.buffer_size = -1, must be at least 1"),
        (("--sac.layers", "0"), "sac.layers = 0, must be at least 1"),
        (("--reward-weights", "hit", "nan"), "reward_weights: hit = nan, must be a finite number"),
        (("--seed", "-1"), "seed = -1, must be from 0 to 4294967295"),
        (("--seed", str(2**32)), "seed = 4294967296, must be from 0 to 4294967295"),
    ],
)
def test_a_number_that_cannot_be_trained_with_begins_no_run(arguments, message, tmp_path, capsys):
    assert run(main, ["--out", str(tmp_path / "run"), *arguments]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_levels_are_robots_side_by_side():
    settings = TrainingSettings(randomize="levels", envs=9, stack=2)
    env = training_env(settings)
    models = level_models(paper_model())
    assert len({json.dumps(model.effects, sort_keys=True, default=dict) for model in models.values()}) == len(
        models
    )
    natives = env.unwrapped.envs
    assert [native.num_envs for native in natives] == [2, 2, 2, 2, 1]
    env.unwrapped._seeds = episode_seeds(settings, 0)
    assert env.reset().shape == (9, 42)
    env.step(np.ones((9, 3), np.float32))
    one = [native.arena.robots.model_of(0) for native in natives]
    assert one == list(models.values())


def test_opponents_and_senses_can_be_varied_in_training():
    env = bare_env(replace(SMALL["ppo"], opponents="varied", senses="varied"))
    setting = env.venv.envs[0].arena.setting
    assert (type(setting.opponents), type(setting.senses)) == (Opponents, VariedSenses)
    assert env.reset().shape == bare_env(SMALL["ppo"]).reset().shape


def test_training_never_meets_an_episode_of_an_evaluation():
    seeds = episode_seeds(TrainingSettings(envs=256), 0)
    assert len(set(seeds)) == 256
    assert min(seeds) > max(DEVELOPMENT_SEEDS)
    assert set(seeds).isdisjoint(episode_seeds(TrainingSettings(envs=256), 250_000))
    assert set(seeds).isdisjoint(episode_seeds(TrainingSettings(envs=256, seed=1), 0))


def test_a_run_names_the_command_that_repeats_it(tmp_path, monkeypatch):
    settings = replace(SMALL["ppo"], seed=3, reward_weights={"hit": 2.0}, randomize="levels")
    begun = []

    def begin(*given):
        begun.append(given)
        return State()

    monkeypatch.setattr("training.train.run.train_policy", begin)
    words = command_line(settings, str(tmp_path)).split()
    assert words[:3] == ["python", "-m", "training.train"]
    assert run(main, words[3:]) == 0
    assert begun == [(settings, tmp_path)]


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
    assert load_policy(run_folder).about["steps_done"] == 384
    assert (run_folder / "policy.npz").read_bytes() == (newest / "policy.npz").read_bytes()
    assert (run_folder / "curve.json").read_bytes() == (folder / "curve.json").read_bytes()


def test_every_crash_of_a_checkpoint_is_mended_by_the_next_resume(trained, tmp_path, monkeypatch):
    settings, folder = trained
    facts = load_policy(folder).about
    monkeypatch.setattr(checkpoint, "about", lambda _, steps, __: facts | {"steps_done": steps})
    run_folder = tmp_path / "run"

    def prepare():
        shutil.rmtree(run_folder, ignore_errors=True)
        copy_of(folder, run_folder)
        state = read_state(newest_checkpoint(run_folder))
        shutil.rmtree(newest_checkpoint(run_folder))
        export_newest(run_folder)
        state_now[0] = replace(state, curve=state.curve)

    state_now = [None]
    agent, normaliser = learner(folder, settings)

    def work():
        write_checkpoint(Run(settings, run_folder, ["train"], agent, normaliser, state_now[0]))

    def check(at):
        export_newest(run_folder)
        steps = load_policy(run_folder).about["steps_done"]
        assert steps == read_state(newest_checkpoint(run_folder)).steps_done, at
        assert len(json.loads((run_folder / "curve.json").read_text())) == steps // 128
        seen.add(steps)

    seen = set()
    assert crash.crash_everywhere(prepare, work, check) > 20
    assert seen == {256, 384}


def test_two_trainings_of_one_folder_are_refused(trained, tmp_path):
    settings, folder = trained
    run_folder, _ = copy_of(folder, tmp_path / "run")
    with lock_folder(run_folder), pytest.raises(InputError, match="another command is writing there"):
        resume(run_folder, steps=settings.steps + 64, quiet=True)
