"""The prediction of the own motion against the simulator, and its bookkeeping."""

import numpy as np
import pytest

from mecanum_env.model import paper_model
from mecanum_env.tankendo.plant import RobotBatch, compile_model
from training.controllers.observed_motion import OwnMotion, seen_from

NAMED = {
    "nothing": {},
    "friction": {
        "coulomb_friction": {"torque_n_m": 0.5},
        "weak_servo": {"servo_n_m_s_rad": 0.5},
        "viscous_friction": {"damping_n_m_s_rad": 0.1},
    },
    "asymmetry": {"direction_asymmetry": {"reverse_ratio": 0.7}},
    "payload": {"payload": {"mass_kg": 8.0, "height_m": 0.2}},
}


def with_effects(effects):
    model = paper_model()
    for name, values in effects.items():
        model = model.with_effect(name, **values)
    return model


def velocity_errors(plant, known, true, seed=0, commands=60):
    """Return predicted minus true body velocity at the end of each command, (commands, 3)."""
    rng = np.random.default_rng(seed)
    robots = RobotBatch(compile_model(true, plant), 1)
    robots.restart(0, (0.0, 0.0, 0.4))
    own, errors = OwnMotion(known), []
    for j in range(commands):
        if j % 4 == 0:
            command = (
                int(rng.integers(0, 80)),
                int(rng.integers(-180, 180)),
                int(rng.integers(-15, 15)),
            )
        robots.step(np.array([command], float))
        own.send(command)
        _, _, yaw, vx, vy, turn = robots.motion()[:, 0]
        cos, sin = np.cos(yaw), np.sin(yaw)
        errors.append(own.twist(0.0) - [cos * vx + sin * vy, cos * vy - sin * vx, turn])
    return np.array(errors)


@pytest.mark.parametrize(("plant", "most"), [("planar", 0.02), ("rollers", 0.05)])
def test_predicts_the_velocity_of_the_simulator(plant, most):
    errors = velocity_errors(plant, paper_model(), paper_model(), commands=32)
    assert np.sqrt(np.mean(errors[:, :2] ** 2)) < most


@pytest.mark.parametrize("name", NAMED)
def test_named_effects_make_the_prediction_better(name):
    model = with_effects(NAMED[name])
    aware = np.sqrt(np.mean(velocity_errors("planar", model, model) ** 2))
    blind = np.sqrt(np.mean(velocity_errors("planar", paper_model(), model) ** 2))
    assert aware < 0.02
    assert aware <= blind
    assert name == "nothing" or aware < 0.4 * blind


def test_steps_add_up_to_the_whole_way():
    own = OwnMotion(paper_model())
    rng = np.random.default_rng(1)
    pose = np.zeros(3)
    for _ in range(8):
        own.send((int(rng.integers(0, 100)), int(rng.integers(-180, 180)), int(rng.integers(-40, 40))))
        step = own.moved(0.1)
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        pose += [cos * step[0] - sin * step[1], sin * step[0] + cos * step[1], step[2]]
    np.testing.assert_allclose(own.moved(0.8), pose, atol=1e-12)
    # The same way in two parts, cut between two ticks of the law.
    first, rest = own.moved(0.53, 0.217), own.moved(0.217)
    x, y = seen_from(first, *own.moved(0.53)[:2])
    np.testing.assert_allclose([x, y], rest[:2], atol=1e-4)


def test_stands_until_it_is_sent_a_command():
    own = OwnMotion(paper_model())
    assert not own.moved(1.0).any()
    own.send((0, 0, 0))
    assert not own.twist(0.0).any()
