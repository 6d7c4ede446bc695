"""Controllers that run on the simulator and, unchanged, in a real robot's loop.

Each has `reset()` and `act(observation) -> (V rpm, theta deg, VC rpm)`, in whole numbers
(`training.controllers.interface.Controller`). The loop on a robot is:

    controller.reset()
    while fighting:                                   # ten times a second
        v, theta, vc = controller.act(observation)    # as `mecanum_env.tankendo.observation` describes it
        robot.send(v, theta, vc)

`training.controllers.named.make_controller` makes a controller by its name. On the simulator, with
`action_mode="command"`:

    observation, reward, ... = env.step(command_to_action(controller.act(observation)))
"""

from training.controllers.interface import Command, Controller, twist_command
from training.controllers.lqr import Lqr
from training.controllers.mpc import Mpc
from training.controllers.oracle import Oracle
from training.controllers.scripted import Creep, RandomMotion, Retreat, SideStep, Still
from training.controllers.tracking import PoseController, Proportional, Smith

__all__ = [
    "Command",
    "Controller",
    "Creep",
    "Lqr",
    "Mpc",
    "Oracle",
    "PoseController",
    "Proportional",
    "RandomMotion",
    "Retreat",
    "SideStep",
    "Smith",
    "Still",
    "twist_command",
]
