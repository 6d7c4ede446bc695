"""What a policy file should be known for, measured: `python -m training.train.card POLICY`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, cast, get_args

import tyro
from tqdm import tqdm

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.files import write_json, write_text
from mecanum_env.model import Model, paper_model, read_model
from mecanum_env.registration import ENVIRONMENTS
from mecanum_env.simulator import RobotPlant
from mecanum_env.tankendo import DIFFICULTIES
from mecanum_env.tankendo.arena import TaskName
from training.controllers.policy import Policy, load_policy
from training.evaluate import Maker, Setup, Share, evaluate, named_maker, share
from training.train.environments import level_models

_BESIDE: Final = "retreat"
_SIMPLE: Final = "scripted retreat"


@dataclass(frozen=True)
class Row:
    """One line of a card's table."""

    robot: str
    """Name of the robot, as in `training.train.environments`."""
    physics: RobotPlant
    difficulty: str
    policy: Share
    beside: Share
    """The scripted retreat on the same episodes."""


def measure(policy: Policy, model: Model, episodes: int, rollers_episodes: int, progress: Any) -> list[Row]:
    """Return what a policy reaches on every level, and on every robot of `training.train.environments`.

    Args:
        policy: to play; it is the same for every episode, begun anew.
        model: of the robot.
        episodes: on the planar plant, seeds 0, 1, ...
        rollers_episodes: on rollers.
        progress: called after each row.
    """
    task = cast(TaskName, ENVIRONMENTS[policy.about["env"]])
    rows = []
    jobs: list[tuple[str, Model, RobotPlant, str]] = [
        ("nominal", model, physics, level) for physics in get_args(RobotPlant) for level in DIFFICULTIES
    ]
    changed = list(level_models(model).items())[1:]
    jobs += [(name, robot, "planar", "normal") for name, robot in changed]
    for name, robot, physics, level in jobs:
        number = episodes if physics == "planar" else rollers_episodes
        if number:
            setup = Setup(robot, physics, task, level, known=model)
            own = _play(lambda *_: Policy(policy.network, policy.about), setup, number)
            rows.append(Row(name, physics, level, own, _play(named_maker(_BESIDE, model), setup, number)))
        progress()
    return rows


def card(name: str, policy: Policy, rows: list[Row], command: str) -> str:
    """Return a policy's card as Markdown.

    Args:
        name: of the policy.
        policy: what its file says is taken from it.
        rows: as measured.
        command: that measured them.
    """
    about, network = policy.about, policy.network
    settings = about["settings"]
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
        "algorithm": f"{settings['algo'].upper()}, seed {settings['seed']}, {about['steps_done']:,} steps",
        "network": f"last {network.stack} observations, normalised; layers "
        f"{', '.join(map(str, algorithm['layers']))}, {network.activation}; {weights:,} weights",
        "output": f"{network.action_mode}: whole numbers V, theta, VC, ten times a second",
        "trained with": ", then ".join(f"`{command}`" for command in about["commands"]),
        "numbers of the algorithm": ", ".join(f"{key} {_short(value)}" for key, value in algorithm.items()),
        "weights of the reward": _pairs(settings["reward_weights"]) or "those of the environment",
        "versions": _pairs(about["versions"]),
    }
    lines = [f"# {name}", "", f"Written by `{command}`; do not edit.", "", "| | |", "|---|---|"]
    lines += [f"| {key} | {value} |" for key, value in facts.items()]
    lines += [
        "",
        "Share of successes with Wilson's 95 % interval, one episode a seed from 0; none was trained on.",
        "",
        f"| robot | plant | difficulty | this policy | {_SIMPLE} | episodes |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        lines.append(
            f"| {row.robot} | {row.physics} | {row.difficulty} | {_interval(row.policy)} | "
            f"{_interval(row.beside)} | {row.policy.trials} |"
        )
    lines += [
        "",
        f"Worst robot at level normal: {worst.robot}, {_interval(worst.policy)}.",
        "",
        "## Limits",
        "",
    ]
    lines += [
        "- The opponent's figures are this project's own (`mecanum_env/tankendo/constants.py`): another",
        "  opponent is another task.",
        "- Nothing above was measured on a real robot. Before one runs it, certify it on the model fitted to",
        "  that robot's logs, and keep an emergency stop at hand.",
        "- It sees what `mecanum_env.tankendo.observation` describes, with that delay and noise.",
    ]
    return "\n".join(lines) + "\n"


_ROBOTS: Final[Mapping[str, str]] = {
    "none": "that robot only",
    "posterior": "robots drawn from what its identification left open",
    "levels": "the robots of the table below side by side",
}


def _play(maker: Maker, setup: Setup, episodes: int) -> Share:
    played = evaluate(maker, setup, range(episodes)).episodes
    return share(sum(episode.success for episode in played), episodes)


def _interval(value: Share) -> str:
    return f"{value.value:.3f} ({value.low:.3f} .. {value.high:.3f})"


def _pairs(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} {value}" for key, value in values.items())


def _short(value: Any) -> str:
    return " x ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def main(
    policy: tyro.conf.Positional[Path],
    /,
    out: Path | None = None,
    model: Path | None = None,
    episodes: int = 500,
    rollers_episodes: int = 200,
) -> None:
    """Measure a policy on every level, plant and robot, and write its card.

    Example: python -m training.train.card out/ppo --out out/ppo/card.md

    Args:
        policy: File or folder that `training.train` wrote.
        out: Markdown to write, with a JSON of the same name beside it; by default beside the policy.
        model: Of the robot; default: the packaged one.
        episodes: Of each row on the planar plant, seeds 0, 1, ...
        rollers_episodes: Of each row on rollers, much slower; 0: none.
    """
    if episodes < 1:
        raise InputError(f"episodes = {episodes}, must be at least 1")
    loaded = load_policy(policy)
    name = policy.stem if policy.suffix else policy.name
    if out is None:
        out = policy / "card.md" if policy.is_dir() else policy.with_suffix(".md")
    robot = paper_model() if model is None else read_model(model)
    total = 2 * len(DIFFICULTIES) + len(level_models(robot)) - 1
    with tqdm(total=total, desc="card", unit="row", disable=None) as bar:
        step: Callable[[], Any] = bar.update
        rows = measure(loaded, robot, episodes, rollers_episodes, step)
    command = f"python -m training.train.card {policy.name}"
    text = card(name, loaded, rows, command)
    write_text(out, text)
    write_json(
        out.with_suffix(".json"),
        {"policy": name, "about": loaded.about, "rows": [asdict(row) for row in rows]},
    )
    print(text)
    print(f"wrote {out} and {out.with_suffix('.json')}")


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m training.train.card"))
