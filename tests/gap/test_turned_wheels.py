"""Initial wheel angles are unknown: the ripple they can cause is counted as noise."""

from __future__ import annotations

import numpy as np
import pytest

from mecanum_env.mjcf import robot_spec
from mecanum_env.model import Model, paper_model
from mecanum_env.simulator import BodyCommands, drive
from mecanum_env.simulator.robot import at_rest, compile_plant, standing
from sysid.compare.least_squares import ResidualProblem, base_fit
from sysid.compare.measured import observe
from sysid.compare.model_error import Whitener
from sysid.compare.noise import measure_noise
from sysid.gap.search.chance import Floor, complete, expected
from sysid.gap.search.sets import EMPTY
from sysid.logs import BodyCommand, Dataset, Run

BASE = paper_model()
TIME = np.arange(0.0, 2.5, 0.02)
LEVELS = ((60.0, 0.0, 0.0), (55.0, 90.0, 0.0), (40.0, 45.0, 20.0))
KNOWN = Floor(1e6, trusted=True)


def problem_of(model: Model, turned: bool) -> ResidualProblem:
    """Return a study of three robot runs, twice each, whose wheels start at angle 0 or at random angles."""
    rng = np.random.default_rng(2)
    compiled = compile_plant(model, visuals=False)
    runs = []
    for number, (v, theta, vc) in enumerate(LEVELS):
        moving = TIME >= 0.2
        command = BodyCommand(*(np.where(moving, level, 0.0) for level in (v, theta, vc)))
        sent = BodyCommands.from_rows([(0.0, 0.0, 0.0, 0.0), (0.2, v, theta, vc)])
        for repeat in range(2):
            angles = rng.uniform(0.0, 2.0 * np.pi, 4) if turned else ()
            stance = standing(compiled, angles)
            path = drive(model, sent, float(TIME[-1]), mj_model=compiled, stance=stance)
            true = path.channels_at(TIME)
            channels = {n: true[n] + 0.005 * rng.standard_normal(TIME.size) for n in ("vx_m_s", "vy_m_s")}
            name = f"run{number}"
            runs.append(Run(f"{name}_{repeat}.csv", name, "fit", TIME, command, channels))
    dataset = Dataset("turned wheels", tuple(runs), (), "made here")
    observations = observe(dataset)
    return ResidualProblem(BASE, Whitener(observations, measure_noise(dataset, observations), None))


def test_a_robot_stands_on_whatever_rollers_it_is_put() -> None:
    compiled = robot_spec(BASE, visuals=False).compile()
    angles = (0.1, -1.0, 2.0, 3.0)
    data = at_rest(compiled, angles)
    assert [data.joint(f"wheel_{w}").qpos[0] for w in ("fl", "fr", "rl", "rr")] == pytest.approx(
        angles, abs=0.02
    )
    assert data.qpos[2] == pytest.approx(at_rest(compiled).qpos[2], abs=1e-3)
    assert not np.any(data.qvel)


@pytest.mark.parametrize("model", [BASE, BASE.with_effect("speed_gain", gain=0.9)])
def test_angles_are_found_unknown_only_where_they_are(model: Model) -> None:
    for turned in (False, True):
        problem = problem_of(model, turned)
        residual = problem.residual(model)
        assert residual is not None
        assert problem.update_angle_uncertainty(model, problem.marginal(residual)) is turned
        assert problem.angle_uncertainty > 0.5 if turned else problem.angle_uncertainty == 0.0


def test_what_turned_wheels_leave_is_no_gap() -> None:
    problem = problem_of(BASE, turned=True)
    base = base_fit(problem, EMPTY)
    assert not complete(problem, base, KNOWN)
    assert problem.update_angle_uncertainty(BASE, base.residual)
    assert complete(problem, base, KNOWN)
    assert expected(problem, base) < 3.0 * base.cost
