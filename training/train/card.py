"""The card of a policy, a page with its measured success: `python -m training.train.card POLICY`."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, cast, get_args

import tyro
from tqdm import tqdm

from mecanum_env.cli import run
from mecanum_env.errors import require_at_least
from mecanum_env.files import write_json, write_text
from mecanum_env.markdown import markdown_table
from mecanum_env.model import Model, paper_model, read_model
from mecanum_env.registration import ENVIRONMENTS
from mecanum_env.simulator import RobotPlant
from mecanum_env.tankendo import DIFFICULTIES
from mecanum_env.tankendo.arena import TaskName
from training.controllers.policy import Policy, load_policy
from training.evaluate import Setup, Share, controller_factory, evaluate_controller
from training.train.robots import level_models

_ROBOTS: Final[Mapping[str, str]] = {
    "none": "that robot only",
    "posterior": "robots drawn from the uncertainty of its identification",
    "levels": "the robots of the table below side by side",
    "varied": "robots drawn late and slow around it",
}
"""Value of `--randomize` -> the robots that were trained on."""


@dataclass(frozen=True)
class Row:
    """One row of a card's table, of a robot named in `training.train.environments.level_models`."""

    robot: str
    physics: RobotPlant
    difficulty: str
    policy: Share
    beside: Share
    """Success of the scripted retreat on the same episodes."""


def measure(policy: Policy, model: Model, episodes: int, rollers_episodes: int, progress: Any) -> list[Row]:
    """Return the success of a policy at every level, and on every robot of `level_models`.

    Each row takes `episodes` on the planar plant, or `rollers_episodes`, with the seeds 0, 1, ...; `progress`
    is called after it.
    """
    task = cast(TaskName, ENVIRONMENTS[policy.about["env"]])
    settings: list[tuple[str, Model, RobotPlant, str]] = [
        ("nominal", model, physics, level) for physics in get_args(RobotPlant) for level in DIFFICULTIES
    ]
    settings += [
        (name, robot, "planar", "normal") for name, robot in level_models(model).items() if name != "nominal"
    ]
    rows, retreat = [], controller_factory("retreat", model)
    for name, robot, physics, level in settings:
        count = episodes if physics == "planar" else rollers_episodes
        if count:
            setup = Setup(robot, physics, task, level, known=model)
            own, baseline = (
                evaluate_controller(factory, setup, range(count)).success
                for factory in (lambda *_: Policy(policy.network, policy.about), retreat)
            )
            rows.append(Row(name, physics, level, own, baseline))
        progress()
    return rows


def card(name: str, policy: Policy, rows: list[Row], command: str) -> str:
    """Return a policy's card as Markdown, with its measured success and the command that measured it.

    Of what a policy file says about itself, `method` names how it was made, if not by an algorithm of
    Stable-Baselines3, and `history`, if any, tells what its commands do not.
    """
    about, network, settings = policy.about, policy.network, policy.about["settings"]
    algorithm = settings[settings["algo"]]
    weights = sum(layer.size for layer in (*network.weights, *network.biases))
    worst = min(
        (row for row in rows if (row.physics, row.difficulty) == ("planar", "normal")),
        key=lambda row: row.policy.value,
    )
    facts = {
        "task": f"{about['env']}, difficulty {settings['difficulty']}",
        "trained on": f"{about['model']['source']}, plant {settings['plant']}, "
        + _ROBOTS[settings["randomize"]],
        "algorithm": f"{about.get('method', settings['algo'].upper())}, seed {settings['seed']}, "
        f"{about['steps_done']:,} steps",
        "network": f"last {network.stack} observations"
        f"{', with the time to the cut' if network.has_time_to_cut else ''}, normalised; layers "
        f"{', '.join(map(str, algorithm['layers']))}, {network.activation}; {weights:,} weights",
        "output": f"{network.action_mode}: whole numbers V, theta, VC, ten times a second",
        "trained with": ", then ".join(f"`{command}`" for command in about["commands"]),
        **({"chosen": _chosen(about["chosen"])} if "chosen" in about else {}),
        **({"history": about["history"]} if "history" in about else {}),
        # What imitates has neither.
        **(
            {}
            if "method" in about
            else {
                "hyperparameters": _pairs(algorithm),
                "weights of the reward": _pairs(settings["reward_weights"]) or "those of the environment",
            }
        ),
        "versions": _pairs(about["versions"]),
    }
    head = ("robot", "plant", "difficulty", "this policy", "scripted retreat", "episodes")
    cells = [
        (
            *(row.robot, row.physics, row.difficulty),
            *(_interval(row.policy), _interval(row.beside), str(row.policy.trials)),
        )
        for row in rows
    ]
    return f"""# {name}

Written by `{command}`; do not edit.

{markdown_table(("", ""), list(facts.items()))}

Share of successes with Wilson's 95 % interval, seeds from 0; no episode was trained on.

{markdown_table(head, cells)}

Worst robot at level normal: {worst.robot}, {_interval(worst.policy)}.

## Limits

- The opponent's parameters are this project's own (`mecanum_env/tankendo/constants.py`): another
  opponent is another task.
- Nothing above was measured on a real robot. Before one runs the policy, certify it on the model fitted to
  that robot's logs, and keep an emergency stop at hand.
- It sees what `mecanum_env.tankendo.observation` describes, with that delay and noise.
"""


def _chosen(chosen: Mapping[str, Any]) -> str:
    return (
        f"the best of {chosen['of']} checkpoints up to {chosen['newest_steps']:,} steps: "
        f"{chosen['success']:.3f} in the run's development episodes, none of which it trained on or plays "
        "below; no robot or opponent that certificates hold out is in them"
    )


def _interval(value: Share) -> str:
    return f"{value.value:.3f} ({value.low:.3f} .. {value.high:.3f})"


def _pairs(values: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{key} {' x '.join(map(str, value)) if isinstance(value, list) else value}"
        for key, value in values.items()
    )


def main(
    policy: tyro.conf.Positional[Path],
    /,
    out: Path | None = None,
    model: Path | None = None,
    episodes: int = 500,
    rollers_episodes: int = 200,
) -> None:
    """Measure a policy at every level, on every plant and robot, and write its card.

    Example: python -m training.train.card out/ppo --out out/ppo/card.md

    Args:
        policy: File or folder that `training.train` wrote.
        out: Markdown file to write, with a JSON file of the same name; by default beside the policy.
        model: Model file of the robot; by default the packaged one.
        episodes: Number of episodes per row on the planar plant, with the seeds 0, 1, ...
        rollers_episodes: The same on rollers, which are much slower; 0: none.
    """
    require_at_least(1, episodes=episodes)
    loaded = load_policy(policy)
    name = policy.stem if policy.suffix else policy.name
    if out is None:
        out = policy / "card.md" if policy.is_dir() else policy.with_suffix(".md")
    robot = paper_model() if model is None else read_model(model)
    total = 2 * len(DIFFICULTIES) + len(level_models(robot)) - 1
    with tqdm(total=total, desc="card", unit="row", disable=None) as bar:
        rows = measure(loaded, robot, episodes, rollers_episodes, bar.update)
    played = f"--episodes {episodes} --rollers-episodes {rollers_episodes}"
    text = card(name, loaded, rows, f"python -m training.train.card {policy.name} {played}")
    write_text(out, text)
    data = out.with_suffix(".json")
    write_json(data, {"policy": name, "about": loaded.about, "rows": [asdict(row) for row in rows]})
    print(f"{text}\nwrote {out} and {data}")


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m training.train.card"))
