"""What waiting in motion is worth: scripts that creep, against opponents that lead their aim differently.

    python benchmarks/waiting.py [EPISODES [FIRST_SEED]]

prints the share of successes with Wilson's 95 % interval, on the model and on the robot level. A script
that creeps and reverses beats one that waits at rest only if the opponent extrapolates the waiting motion.
"""

from __future__ import annotations

import sys
from dataclasses import replace

from mecanum_env.model import paper_model
from mecanum_env.tankendo import Opponent
from training.certify.checks import share_text
from training.certify.plants import robot_level
from training.certify.report import columns
from training.controllers.scripted import Creep, Retreat, SideStep
from training.controllers.tracking import Proportional
from training.evaluate import Setup, evaluate_controller

SCRIPTS = {
    "at rest (sidestep)": lambda: SideStep(Proportional()),
    "creep and reverse (creep)": lambda: Creep(Proportional()),
    "creep and go on": lambda: Creep(Proportional(), onward=True),
}
OPPONENTS = {
    "constant velocity": Opponent(lead_form="constant_velocity"),
    "none": Opponent(lead_form="none"),
    "adaptive (default)": Opponent(),
}


def success(script: str, setup: Setup, seeds: range) -> str:
    """Return the success of a script as text."""

    def make(*_: object) -> Retreat:
        return SCRIPTS[script]()

    return share_text(evaluate_controller(make, setup, seeds).success)


def main(episodes: int = 200, first_seed: int = 100_000) -> None:
    """Print the table for a number of episodes, whose seeds begin with one."""
    seeds = range(first_seed, first_seed + episodes)
    model = paper_model()
    for plant, robot in {"the model": model, "the paper's robot level": robot_level(model)}.items():
        rows = [("lead of the opponent", *SCRIPTS)]
        for name, opponent in OPPONENTS.items():
            setup = replace(Setup(robot, known=model), opponent=opponent)
            rows.append((name, *(success(script, setup, seeds) for script in SCRIPTS)))
        title = f"{plant}, {episodes} episodes, seeds from {first_seed}"
        print(title, *columns(rows), "", sep="\n", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]))
