"""Physics options shared by every model: integrator, solver, contact and the time step."""

from __future__ import annotations

import math

import mujoco

from mecanum_env.errors import InputError
from mecanum_env.model import Model

SIMULATION_TIMESTEP_S = 1 / 480
"""What a study of the robot uses, or a little less (`fitting_timestep`)."""
TRAINING_TIMESTEP_S = 1 / 240
"""What training uses: half the cost. Over ten seconds of commands like the paper's, held for 0.2 and 0.8 s,
the path is that of 1/960 s within 1 %; with a new random command every 0.1 s the rollers' path is off by
2 to 6 % (at 1/480 s by 0.4 to 1.1 %), that of the planar plant by 0.3 %."""

SOLIMP = (0.99, 0.999, 0.001, 0.5, 2.0)
"""Contact impedance. MuJoCo's default gives 2 mm of bounce and loses a tenth of sideways motion."""


def fitting_timestep(model: Model, at_most_s: float | None = None) -> float:
    """Return the largest step up to `at_most_s` [s] of which the law's sample period is a whole multiple.

    Args:
        model: its wheel law's period counts.
        at_most_s: upper bound; by default `SIMULATION_TIMESTEP_S`.

    Raises:
        InputError: `at_most_s` is not a number above 0.
    """
    if at_most_s is None:
        at_most_s = SIMULATION_TIMESTEP_S
    if not (math.isfinite(at_most_s) and at_most_s > 0.0):
        raise InputError(f"timestep_s = {at_most_s}, must be above 0, such as {SIMULATION_TIMESTEP_S:.6g}")
    period = model.wheel.law.sample_period_s
    # A hair less: 1/120 over 1/480 must be 4 steps whatever the last digit says.
    return period / max(1, math.ceil(period / at_most_s - 1e-9))


def new_spec(name: str, timestep_s: float) -> mujoco.MjSpec:
    """Return an empty spec with the options that were tuned for roller contact.

    `sparse` on purpose: for a model of this size "auto" picks dense, which takes twice as long.
    """
    spec = mujoco.MjSpec()
    spec.modelname = name
    spec.compiler.autolimits = True
    spec.option.timestep = timestep_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    return spec


def add_floor_pair(spec: mujoco.MjSpec, roller: str, friction: float, timestep_s: float) -> None:
    """Let a roller touch the floor: stiff contact, two time steps long, with Coulomb friction."""
    pair = spec.add_pair(name=f"{roller}_floor", geomname1=roller, geomname2="floor")
    pair.condim = 3
    pair.friction = [friction, friction, 0.005, 0.0001, 0.0001]
    pair.solref = [2 * timestep_s, 1.0]
    pair.solimp = SOLIMP
