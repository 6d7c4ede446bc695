"""Robots drawn from the uncertainty of the identification."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.tankendo.plant import compile_model
from mecanum_env.tankendo.randomize import sampler_for
from mecanum_env.tankendo.vector import TankendoVectorEnv


def known(paper, spread=0.01, **more):
    """Return the paper's model with a covariance in which the coefficients' sum does not change."""
    root = spread * (np.eye(6) - np.full((6, 6), 1 / 6))
    return replace(paper, uncertainty={"wheel": {"covariance": (root @ root.T).tolist()}, **more})


def laws(model, n=300):
    sampler, rng = sampler_for("posterior", model), np.random.default_rng(0)
    drawn = [sampler.draw(rng).wheel.law for _ in range(n)]
    return np.array([[getattr(law, name) for name in COEFFICIENTS] for law in drawn]), drawn


def test_laws_spread_as_their_covariance_says(paper):
    model = known(paper, spread=0.002)
    drawn, _ = laws(model, 2000)
    expected = np.array(model.uncertainty["wheel"]["covariance"])
    np.testing.assert_allclose(np.cov(drawn.T), expected, atol=0.15 * expected.max())


def test_drawn_laws_are_stable_and_keep_their_gain(paper):
    drawn, all_laws = laws(known(paper, spread=0.15))
    assert all(law.is_stable for law in all_laws)
    own = sum(getattr(paper.wheel.law, name) for name in COEFFICIENTS)
    np.testing.assert_allclose(drawn.sum(axis=1), own, atol=1e-12)


def test_a_spread_that_is_all_unstable_is_refused(paper):
    sampler = sampler_for("posterior", known(paper, spread=1e6))
    with pytest.raises(InputError, match="unstable"):
        sampler.draw(np.random.default_rng(0))


def test_effects_come_evenly_from_their_intervals(paper):
    ends = {"speed_gain": {"gain": {"low": 0.8, "high": 0.9, "value": 0.85}}}
    model = replace(paper, uncertainty={"effects": ends})
    sampler, rng = sampler_for("posterior", model), np.random.default_rng(0)
    gains = [sampler.draw(rng).effects["speed_gain"]["gain"] for _ in range(300)]
    assert 0.8 <= min(gains) < 0.81
    assert 0.89 < max(gains) <= 0.9


def test_what_was_fitted_of_the_robot_spreads_by_its_standard_error(paper):
    model = replace(paper, uncertainty={"robot": {"friction": 0.05}})
    sampler, rng = sampler_for("posterior", model), np.random.default_rng(0)
    drawn = [sampler.draw(rng).robot.friction for _ in range(500)]
    assert np.mean(drawn) == pytest.approx(0.8, abs=0.01)
    assert np.std(drawn) == pytest.approx(0.05, rel=0.15)


def test_own_ranges_leave_the_rest_of_an_effect_alone(paper):
    model = paper.with_effect("sensor_bias", vx_m_s=0.02)
    sampler = sampler_for({"effects.sensor_bias.vy_m_s": (0.01, 0.02), "robot.mass_kg": (18, 22)}, model)
    drawn = sampler.draw(np.random.default_rng(0))
    assert drawn.effects["sensor_bias"]["vx_m_s"] == 0.02
    assert 0.01 <= drawn.effects["sensor_bias"]["vy_m_s"] <= 0.02
    assert 18 <= drawn.robot.mass_kg <= 22
    assert drawn.wheel == model.wheel


def test_nothing_is_drawn_by_default(paper):
    assert sampler_for("none", known(paper)) is None


def test_each_episode_has_a_robot_of_its_own(make, paper):
    env = make(model=known(paper), randomize="posterior")
    seen = []
    for _ in range(3):
        env.reset(seed=None if seen else 1)
        seen.append(env.arena.robots.model_of(0).wheel.law.A)
    assert len(set(seen)) == 3
    env.reset(seed=1)
    assert seen[0] == env.arena.robots.model_of(0).wheel.law.A


def test_a_drawn_robot_moves_otherwise(make):
    ends = []
    for gain in (0.5, 1.0):
        env = make(randomize={"effects.speed_gain.gain": (gain, gain)}, action_mode="command")
        env.reset(seed=0)
        start = env.arena.scenes.now[:2, 0].copy()
        for _ in range(10):
            env.step(np.array([-0.5, 0, 0], np.float32))
        ends.append(float(np.linalg.norm(env.arena.scenes.now[:2, 0] - start)))
    assert ends[0] == pytest.approx(0.5 * ends[1], rel=0.1)


@pytest.mark.parametrize("plant", ["planar", "rollers"])
@pytest.mark.parametrize(
    "ranges",
    [
        {"effects.payload.mass_kg": (0, 10)},
        {"effects.com_offset.x_m": (-0.1, 0.1), "effects.com_offset.y_m": (-0.1, 0.1)},
        {"effects.com_offset.y_m": (0, 0)},
    ],
)
def test_effects_that_change_how_a_robot_is_built_can_be_drawn(make, plant, ranges):
    vector, single = TankendoVectorEnv(2, plant=plant, randomize=ranges), make(plant=plant, randomize=ranges)
    actions = np.random.default_rng(0).uniform(-0.3, 0.3, (5, 2, 3)).astype(np.float32)
    vector.reset(seed=0)
    single.reset(seed=1)
    for action in actions:
        np.testing.assert_array_equal(vector.step(action)[0][1], single.step(action[1])[0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"randomize": {"robot.mass_kg": (-5, 20)}}, "randomize: robot.mass_kg = -5.0, must be"),
        ({"randomize": {"wheel.saturation_rpm": (0, 20)}}, "randomize: wheel.saturation_rpm = 0.0"),
        ({"randomize": {"effects.battery_sag.per_volt": (-1, 1)}}, r"per_volt = \(-1, 1\), must lie"),
        ({"randomize": {"effects.low_grip.friction": (0.1, 0.2)}}, "planar plant cannot"),
    ],
)
def test_what_the_ends_of_a_range_cannot_be_is_said_at_once(make, arguments, message):
    with pytest.raises(InputError, match=message):
        make(**arguments)


@pytest.mark.parametrize(
    ("ranges", "message"),
    [
        ({"effects.command_latency.delay_s": (-1, -0.1)}, "must lie within 0 .. inf"),
        ({"effects.floor_slope.slope_deg": (0, 60)}, "must lie within 0 .. 45"),
        ({"robot.mas_kg": (1, 2)}, 'did you mean "robot.mass_kg"'),
        ({"effects.speed_gain.gian": (1, 2)}, "did you mean"),
        ({"robot.mass_kg": 20}, "must be two numbers"),
        ({"robot.mass_kg": (22, 18)}, "the lower number first"),
    ],
)
def test_ranges_that_are_none_are_refused(paper, ranges, message):
    with pytest.raises(InputError, match=message):
        sampler_for(ranges, paper)


LINKS = {
    "jitter": {"command_latency/jitter": {"delay_s": 0.15, "jitter_s": 0.08}},
    "loss": {"command_loss": {"share": 0.3}},
    "loss_before_limits": {"command_loss": {"share": 0.3}, "body_speed_limit": {"v_rpm": 90.0}},
}


def with_link(paper, name):
    for effect, values in LINKS[name].items():
        paper = paper.with_effect(effect, **values)
    return paper


def driven(env, seeds, steps=12):
    """Return what one environment after another shows of its own motion, reset by each of the seeds."""
    shown = []
    for seed in seeds:
        env.reset(seed=seed, options={"start": (-1.0, 0.0, 0.0)})
        actions = 0.5 * np.sin(np.arange(steps) * [[1.0], [0.7], [0.4]]).T
        for action in actions:
            env.step(np.tile(action, (env.num_envs, 1)).astype(np.float32))
        shown.append(env.arena.robots.motion())
    return np.array(shown)


@pytest.mark.parametrize("name", LINKS)
def test_each_episode_has_its_own_chance_of_the_link(paper, name):
    env = TankendoVectorEnv(2, task="track", model=with_link(paper, name))
    one, other = driven(env, [1, None])
    assert not np.array_equal(one, other)


@pytest.mark.parametrize("name", LINKS)
def test_the_seed_of_an_episode_repeats_the_chance_of_the_link(paper, name):
    env = TankendoVectorEnv(2, task="track", model=with_link(paper, name))
    first, _, repeated = driven(env, [1, 2, 1])
    np.testing.assert_array_equal(first, repeated)


@pytest.mark.parametrize("name", LINKS)
def test_robots_side_by_side_differ_in_their_links_and_equal_the_single_environment(paper, name):
    model = with_link(paper, name)
    both = driven(TankendoVectorEnv(2, task="track", model=model), [[5, 6]])[0]
    alone = driven(TankendoVectorEnv(1, task="track", model=model), [6])[0]
    assert not np.array_equal(both[:, 0], both[:, 1])
    np.testing.assert_array_equal(both[:, 1], alone[:, 0])


def test_a_random_link_leaves_the_rest_of_the_episode_as_it_is(paper):
    arenas = [TankendoVectorEnv(1, model=model) for model in (paper, with_link(paper, "loss"))]
    for env in arenas:
        env.reset(seed=3)
    perfect, lossy = (env.arena.chance for env in arenas)
    for step in (0, 20):
        np.testing.assert_array_equal(perfect.noise.at(step), lossy.noise.at(step))
    np.testing.assert_array_equal(perfect.start_pose, lossy.start_pose)


def test_drawn_robots_drive_as_robots_compiled_for_each_episode(make, paper):
    ranges = {
        "robot.mass_kg": (18.0, 24.0),
        "robot.wheel_radius_m": (0.074, 0.078),
        "effects.speed_gain.gain": (0.9, 1.0),
        "effects.command_latency.delay_s": (0.0, 0.1),
        "effects.coulomb_friction.torque_n_m": (0.0, 0.1),
    }
    envs = [make(model=known(paper), randomize=ranges) for _ in range(2)]
    fresh = envs[1].unwrapped
    drawn = replace(fresh._episodes.drawn, compiler=partial(compile_model, plant="planar"))
    fresh._episodes = replace(fresh._episodes, drawn=drawn)
    actions = np.random.default_rng(0).uniform(-1, 1, (20, 3)).astype(np.float32)
    for seed in range(8):
        seen = [[env.reset(seed=seed)[0], *(env.step(action)[0] for action in actions)] for env in envs]
        np.testing.assert_array_equal(*seen)
