"""What training for late and unknown robots adds: drawn robots, a curriculum, a critic and a teacher."""

from dataclasses import fields, replace

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from mecanum_env.cli import run as cli_run
from mecanum_env.effects.apply import drive_parameters
from mecanum_env.errors import InputError
from mecanum_env.senses import VariedSenses
from mecanum_env.tankendo import Observed
from training.controllers.features import features
from training.controllers.mpc import Mpc
from training.controllers.policy import load_network, load_policy
from training.train import planned
from training.train.agent import make_agent, network_of
from training.train.checkpoint import read_run
from training.train.curve import read_curve
from training.train.environments import (
    engine_for,
    native_envs,
    opponents_of,
    training_env,
    warning_range,
)
from training.train.imitation import Imitation
from training.train.mirror import FEATURE_SIGNS
from training.train.privileged import PRIVILEGED
from training.train.robots import level_models, varied_models
from training.train.run import resume, train_policy
from training.train.score import successes
from training.train.settings import Ppo, TrainingSettings

SMALL = TrainingSettings(
    steps=256,
    envs=4,
    stack=3,
    checkpoint_every=128,
    randomize="varied",
    opponents="varied",
    senses="mixed",
    privileged="critic",
    ppo=Ppo(rollout_steps=16, batch_size=32, epochs=2, layers=(8,)),
)
OBSERVED = [one.name for one in fields(Observed)]
WATCH = range(100_000, 100_004)


def test_drawn_robots_are_as_late_as_the_range_says(paper):
    drawn = varied_models(paper, (0.05, 0.15), 200, np.random.default_rng(0))
    delays = np.array([drive_parameters(one).delay_s for one in drawn])
    assert np.all((delays == 0.0) | ((delays >= 0.05) & (delays <= 0.15)))
    assert 0.15 < np.mean(delays == 0.0) < 0.35
    assert any("speed_saturation" in one.effects for one in drawn)


def test_drawn_robots_come_from_the_intervals_of_the_gap(paper):
    found = replace(
        paper.with_effect("speed_gain", gain=0.9),
        uncertainty={"effects": {"speed_gain": {"gain": {"low": 0.8, "high": 0.95}}}},
    )
    gains = [
        one.effects["speed_gain"]["gain"]
        for one in varied_models(found, (0.0, 0.1), 50, np.random.default_rng(1))
    ]
    assert min(gains) < 0.83 < 0.92 < max(gains)


def test_the_range_of_the_warning_widens_with_the_steps():
    settings = TrainingSettings(
        steps=1000, opponents="varied", first_warning_s=(0.5, 0.6), warning_s=(0.3, 1.0), curriculum=0.5
    )
    assert warning_range(settings, 0) == (0.5, 0.6)
    assert warning_range(settings, 250) == pytest.approx((0.4, 0.8))
    assert warning_range(settings, 800) == (0.3, 1.0)
    assert opponents_of(settings, 800).base.warning_s == (0.3, 1.0)
    assert warning_range(replace(settings, curriculum=0.0), 0) == (0.3, 1.0)


def test_mixed_senses_are_shared_out():
    envs = native_envs(SMALL)
    assert [env.num_envs for env in envs] == [2, 2]
    assert envs[0].arena.setting.senses is None
    assert isinstance(envs[1].arena.setting.senses, VariedSenses)


def test_arrays_step_what_they_know(paper):
    assert engine_for(paper, "planar") == "arrays"
    assert engine_for(paper, "rollers") == "mujoco"


def test_the_privileged_numbers_follow_the_features_and_know_the_strike():
    env = training_env(SMALL).venv.venv
    plain = training_env(replace(SMALL, privileged="none")).venv.venv
    seen = env.reset()
    assert seen.shape[1] == plain.observation_space.shape[0] + PRIVILEGED
    arena = env.venv.envs[0].arena
    assert seen[0, -PRIVILEGED] == pytest.approx(drive_parameters(arena.robots.model_of(0)).delay_s)
    for _ in range(30):
        seen, _, done, infos = env.step(np.zeros((4, 3), np.float32))
        for row in np.flatnonzero(done):
            assert infos[row]["terminal_observation"].shape == seen[row].shape


def test_the_actor_is_blind_to_what_is_privileged():
    env = training_env(SMALL)
    agent = make_agent(SMALL, env)
    seen = env.reset()
    changed = seen.copy()
    changed[:, -PRIVILEGED:] += 1.0
    one, other = (agent.predict(x, deterministic=True)[0] for x in (seen, changed))
    np.testing.assert_array_equal(one, other)
    assert network_of(agent, env, SMALL).mean.shape == (seen.shape[1] - PRIVILEGED,)


def test_an_interrupted_run_on_drawn_robots_ends_with_the_same_weights(tmp_path):
    settings = replace(SMALL, senses="off")
    train_policy(settings, tmp_path / "one", development_seeds=WATCH, quiet=True)
    train_policy(settings, tmp_path / "two", stop_after=100, development_seeds=WATCH, quiet=True)
    resume(tmp_path / "two", development_seeds=WATCH, quiet=True)
    one, two = (load_policy(tmp_path / name).network.weights for name in ("one", "two"))
    assert all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))


def test_a_student_learns_to_do_what_its_teacher_does(tmp_path):
    wide = Ppo(rollout_steps=32, batch_size=64, epochs=20, layers=(32,), log_std=-2.0)
    settings = replace(
        SMALL, steps=4096, envs=32, checkpoint_every=4096, teacher="robust", teacher_steps=4096, ppo=wide
    )
    train_policy(settings, tmp_path / "run", development_seeds=WATCH, quiet=True)
    student, (teacher, _) = load_policy(tmp_path / "run").network, load_network_of("robust")
    env = training_env(settings).venv.venv
    seen = env.reset()[:, :-PRIVILEGED]
    wanted = teacher.actions(seen[:, -len(teacher.mean) :])
    untaught = network_of(make_agent(settings, training_env(settings)), training_env(settings), settings)
    error, before = (np.mean((one.actions(seen) - wanted) ** 2) for one in (student, untaught))
    assert error < 0.2 * before


def load_network_of(name):
    from training.controllers.policy import bundled

    return load_network(bundled(name))


def test_a_teacher_that_sees_more_is_no_policy_and_teaches_one(tmp_path):
    seeing = replace(SMALL, privileged="both", stack=2)
    train_policy(seeing, tmp_path / "teacher", development_seeds=WATCH, quiet=True)
    with pytest.raises(InputError, match="sees what no robot senses"):
        load_policy(tmp_path / "teacher")
    taught = replace(SMALL, teacher=str(tmp_path / "teacher"), teacher_steps=128)
    train_policy(taught, tmp_path / "student", development_seeds=WATCH, quiet=True)
    student = load_policy(tmp_path / "student")
    assert student.network.stack == 3
    # Both commands repeat the student: the teacher's own comes first.
    assert [
        f"--out {tmp_path / name}" in command
        for name, command in zip(("teacher", "student"), student.about["commands"], strict=True)
    ] == [True, True]
    with pytest.raises(InputError, match="sees privileged numbers"):
        make_agent(replace(taught, privileged="none"), training_env(replace(taught, privileged="none")))
    with pytest.raises(InputError, match="give at least as long a --stack"):
        make_agent(replace(taught, stack=1), training_env(replace(taught, stack=1)))


def test_a_policy_that_is_trained_with_the_time_to_the_cut_sees_it(tmp_path):
    settings = replace(SMALL, time_to_cut=True, senses="off")
    env = training_env(settings).venv.venv
    plain = training_env(replace(settings, time_to_cut=False)).venv.venv
    seen, without = env.reset(), plain.reset()
    each = (without.shape[1] - PRIVILEGED) // 3
    assert seen.shape[1] == without.shape[1] + 3
    # On guard, at the start of an episode.
    np.testing.assert_array_equal(seen[:, each], np.float32(0.6))
    train_policy(settings, tmp_path / "run", development_seeds=WATCH, quiet=True)
    network = load_policy(tmp_path / "run").network
    assert (network.has_time_to_cut, network.observation_size) == (True, 20)
    with pytest.raises(InputError, match="does not see the time to the cut"):
        make_agent(replace(settings, teacher="robust"), training_env(settings))


def test_the_score_is_that_of_the_episodes_one_by_one(paper):
    from training.controllers.policy import Policy, bundled
    from training.evaluate import Setup, evaluate_controller

    network, about = load_network(bundled("robust"))
    late = level_models(paper)["late"]
    won = successes(network, range(20), model=late, engine="arrays")
    episodes = evaluate_controller(lambda *_: Policy(network, about), Setup(late), range(20)).episodes
    # Rounding may decide a fight that is close.
    assert np.mean(won != [one.success for one in episodes]) <= 0.1


def test_advice_predicts_with_the_commands_that_were_sent(paper):
    observation = np.zeros(20)
    observation[[0, 4, 6, 18]] = 1.7, 0.85, 0.58, 1.0
    told, silent, alone = Mpc(paper), Mpc(paper), Mpc(paper)
    for _ in range(3):
        told.advise(observation)
        told.sent(alone.act(observation))
        silent.advise(observation)
    moved = [one._motion.own.twist(0.0) for one in (told, alone, silent)]
    np.testing.assert_array_equal(moved[0], moved[1])
    assert not np.any(moved[2])


@pytest.fixture(scope="module")
def imitated(tmp_path_factory):
    """Return the folder of a tiny imitation of the planner."""
    folder = tmp_path_factory.mktemp("planned")
    arguments = ["--steps", "96", "--envs", "2", "--stack", "3", "--layers", "8", "--seed", "1"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(planned, "DEVELOPMENT_SEEDS", WATCH)
        assert cli_run(planned.main, ["--out", str(folder), *arguments]) == 0
    return folder


def test_a_policy_that_imitates_the_planner_teaches_another(imitated):
    taught = replace(SMALL, teacher=str(imitated), teacher_steps=128)
    make_agent(taught, training_env(taught))


def test_an_imitation_says_what_repeats_it(imitated):
    settings, facts = read_run(imitated)
    assert load_policy(imitated).about["commands"] == facts["commands"]
    assert facts["commands"][0].endswith("--seed 1 --stack 3 --layers 8 --steps 96 --envs 2 --senses mixed")
    assert [point.steps for point in read_curve(imitated)] == [16, 32, 48, 64, 80, 96]
    assert settings.stack == 3


def test_imitating_again_gives_the_same_weights(imitated):
    settings, _ = read_run(imitated)
    again = Imitation(settings)
    for number, (share, noise) in enumerate(planned.ROUNDS, start=1):
        again.collect(settings.steps // len(planned.ROUNDS), share, noise)
        again.fit(planned.epochs_of(number))
    for one, other in zip(again.network().weights, load_policy(imitated).network.weights, strict=True):
        np.testing.assert_array_equal(one.astype(np.float32), other)


def test_the_mirror_changes_left_and_right():
    observation = np.random.default_rng(0).normal(size=20)
    left = [name.endswith("_y") or name in ("vy", "opponent_vy", "tip_vy", "y") for name in OBSERVED]
    left = np.array(left) | np.isin(OBSERVED, ("yaw_rate", "left_share", "turn_share", "heading_sin"))
    np.testing.assert_allclose(
        features(np.where(left, -observation, observation)), FEATURE_SIGNS * features(observation)
    )


def test_a_student_of_the_teachers_shape_begins_as_it(imitated):
    taught = replace(SMALL, senses="off", teacher=str(imitated), teacher_steps=128)
    env = training_env(taught)
    agent, teacher = make_agent(taught, env), load_policy(imitated).network
    assert agent.begin_as(env)
    seen = np.random.default_rng(0).normal(size=(5, len(teacher.mean)))
    np.testing.assert_allclose(network_of(agent, env, taught).actions(seen), teacher.actions(seen), atol=1e-5)


def test_a_student_of_another_shape_begins_by_itself(imitated):
    wider = replace(SMALL, teacher=str(imitated), ppo=replace(SMALL.ppo, layers=(9,)))
    env = training_env(wider)
    assert not make_agent(wider, env).begin_as(env)
