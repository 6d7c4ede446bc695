"""How far a robot's simulation is from that with ever shorter physics steps.

The physics of the planar plant converges in proportion to the step. What a step of half the length changes is
therefore as much as all shorter ones would change together. A model may be exact, but its simulation is not:
against good sensors the difference shows, and looks like a small load or a small error of radius.
"""

from __future__ import annotations

from dataclasses import replace

from mecanum_env.mjcf.physics import SIMULATION_TIMESTEP_S
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.measured import Observations
from sysid.compare.predicted import SimulationSettings, Simulator


def step_error(
    model: Model, observations: Observations, settings: SimulationSettings
) -> list[FloatArray] | None:
    """Return what the physics step changes in the predictions of some observations, (m,) for each block.

    None on the bench, whose wheel is computed exactly at each tick of its law, and on rollers, whose contacts
    are tuned to the step.

    Raises:
        InputError: an effect that cannot be simulated.
        SimulationDivergedError: the state stopped being finite.
    """
    if observations.situations[0].runs[0].level == "bench" or settings.plant != "planar":
        return None
    step = SIMULATION_TIMESTEP_S if settings.timestep_s is None else settings.timestep_s
    coarse, fine = (
        Simulator(observations, replace(settings, timestep_s=length)).predictions(model)
        for length in (step, 0.5 * step)
    )
    return [2.0 * (one - other) for one, other in zip(coarse, fine, strict=True)]
