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

interface          what a controller is, and the step from a twist to a command
named              controllers by name
scripted           baselines: standing still, random commands, evasion by a script
tracking, lqr      keeping a distance: P, Smith predictor; optimal tracking on the identified law
mpc                plans on the identified law against the strike as it is estimated
oracle             rehearses the episode on the simulator itself; `dodges` are what it tries
policy             a trained policy, with NumPy alone; `features` is what its network sees
compensation       known effects undone around any controller; `drive_inverse` undoes those of the drives
foresight          a strike planned with what only the simulator knows
motion_model       the robot's own motion, predicted for many robots
wheel_drives       what the four drives make of commands, all at once
observed_motion    from late observations to the present
identified_motion  the delay and the speed of a robot, found while it moves
strike             when the opponent's strike lands
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
