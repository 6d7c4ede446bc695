"""A robot of a study is driven on the planar plant with effects that only MuJoCo knows, too."""

import mujoco
import numpy as np
import pytest

from mecanum_env.effects.catalogue import registered
from mecanum_env.effects.definition import Effect, Parameter, Values
from mecanum_env.errors import EffectRefusedError
from mecanum_env.model import Model, paper_model
from mecanum_env.simulator import BodyCommands, drive
from sysid.compare.measured import Start
from sysid.compare.predicted import SimulationSettings
from sysid.compare.predicted.robot import CompiledRobot
from sysid.logs import BodyCommand, Run

TIME = np.arange(0.0, 2.0, 0.02)
COMMANDS = BodyCommand(np.where(TIME < 0.3, 0.0, 60.0), np.full(TIME.size, 30.0), np.full(TIME.size, 10.0))
RUN = Run("a.csv", "a", "fit", TIME, COMMANDS, {})
PLANAR = SimulationSettings("planar", timestep_s=1 / 240)


def braked(spec: mujoco.MjSpec, values: Values, _model: Model, _plant: str) -> None:
    spec.joint("base_x").damping[0] += values["damping"]


CARPET = Effect(
    name="carpet",
    station="body",
    acts_on="body",
    parameters=(Parameter("damping", "N s/m", 0.0, (0.0, 500.0)),),
    summary="s",
    signature="s",
    change_spec=braked,
)


def test_an_effect_without_a_form_for_batches_is_simulated_by_mujoco() -> None:
    with registered(CARPET):
        model = paper_model().with_effect("carpet", damping=200.0)
        motion = CompiledRobot(model, PLANAR).motion(RUN, Start())
        commands = BodyCommands(TIME, COMMANDS.v_rpm, COMMANDS.theta_deg, COMMANDS.vc_rpm)
        there = drive(model, commands, TIME[-1], plant="planar", timestep_s=1 / 240)
    np.testing.assert_allclose(motion.channels["vx_m_s"], there.twist[:, 0], atol=1e-9)
    plain = CompiledRobot(paper_model(), PLANAR).motion(RUN, Start())
    assert np.max(np.abs(plain.channels["x_m"] - motion.channels["x_m"])) > 0.01


def test_an_effect_that_the_planar_plant_refuses_is_refused() -> None:
    with pytest.raises(EffectRefusedError, match="low_grip"):
        CompiledRobot(paper_model().with_effect("low_grip", friction=0.1), PLANAR)
