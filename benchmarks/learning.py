"""How much of the past a policy needs to meet late and unknown robots: observations in a row, or a memory.

Example: python benchmarks/learning.py --markdown docs/results/learning.md

The planner's advice (`training.train.imitation`) is collected once for each seed, by the recipe's own network
of sixteen observations. Networks that see the last 2, 6 or 16 of them, and a recurrent one (a gated recurrent
unit that reads the sixteen one after the other), are fitted to the same advice with the same number of passes
and play held-out rows of a certificate.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from learning_page import page
from reachable import play
from recordings import print_page

from mecanum_env.checkout import commit
from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.files import write_json
from mecanum_env.model import paper_model
from mecanum_env.reading import read_json
from mecanum_env.tankendo import opponent_for
from mecanum_env.tankendo.actions import ActionMode
from mecanum_env.units import FloatArray
from training.certify.plants import RobotVariant
from training.certify.variations import certificate_variants
from training.train.imitation import Imitation, fit_to_advice, new_layers, scale_of, scaled
from training.train.mirror import ACTION_SIGNS, FEATURE_SIGNS
from training.train.planned import ROUNDS
from training.train.score import successes
from training.train.settings import Ppo, TrainingSettings

ROWS: Final = ("nominal", "latency+0.1s", "late-and-slow", "sluggish", "quick", "deliberate", "long-armed")
"""Rows of the certificate that are played."""
_STACK: Final = 16
_FEATURES: Final = len(FEATURE_SIGNS)
_UNITS: Final = 96
WAYS: Final = ("2 observations", "6 observations", "16 observations", "recurrent")
"""What is compared."""


@dataclass(frozen=True, eq=False)
class Learner:
    """A network that can be fitted."""

    act: Callable[[torch.Tensor], torch.Tensor]
    """Scaled features of all sixteen observations, shape (n, k), to actions, shape (n, 3)."""
    parameters: Sequence[torch.nn.Parameter]


@dataclass(frozen=True, eq=False)
class Student:
    """A fitted network as `successes` plays it."""

    learner: Learner
    scale: FloatArray
    stack: int = _STACK
    privileged: int = 0
    action_mode: ActionMode = "cartesian"

    def actions(self, stacked: FloatArray) -> FloatArray:
        """Return the actions, shape (n, 3), for stacked features."""
        with torch.no_grad():
            acted: FloatArray = self.learner.act(scaled(stacked, self.scale)).numpy().astype(float)
        return np.clip(acted, -1.0, 1.0)


def new_learner(way: str) -> Learner:
    """Return the learner of one of `WAYS`."""
    return _recurrent() if way == "recurrent" else _last_few(int(way.split()[0]))


def _last_few(count: int) -> Learner:
    """Return two hidden layers on the last `count` observations."""
    size = count * _FEATURES
    layers = new_layers((size, _UNITS, _UNITS, len(ACTION_SIGNS)))
    return Learner(lambda seen: layers(seen[:, -size:]), list(layers.parameters()))


def _recurrent() -> Learner:
    """Return a gated recurrent unit that reads the observations one after the other."""
    unit = torch.nn.GRU(_FEATURES, _UNITS, batch_first=True)
    last = torch.nn.Linear(_UNITS, len(ACTION_SIGNS))

    def act(seen: torch.Tensor) -> torch.Tensor:
        states, _ = unit(seen.unflatten(1, (_STACK, _FEATURES)))
        actions: torch.Tensor = last(states[:, -1])
        return actions

    return Learner(act, [*unit.parameters(), *last.parameters()])


def fit(way: str, imitation: Imitation, passes: int, seed: int) -> Student:
    """Fit the learner of a way to all advice of an imitation."""
    torch.manual_seed(seed)
    learner, samples = new_learner(way), imitation.samples()
    scale = scale_of(samples[0])
    fit_to_advice(learner.act, learner.parameters, samples, scale, passes)
    return Student(learner, scale)


def advice_of(seed: int, steps: int) -> Imitation:
    """Return an imitation of plain sensors that has collected its advice; its own network drives."""
    settings = TrainingSettings(
        seed=seed,
        stack=_STACK,
        steps=steps,
        envs=48,
        randomize="varied",
        opponents="varied",
        ppo=Ppo(layers=(_UNITS, _UNITS)),
    )
    imitation = Imitation(settings)
    for number, (share, noise) in enumerate(ROUNDS, start=1):
        imitation.collect(steps // len(ROUNDS), share, noise)
        if number < len(ROUNDS):
            imitation.fit(4)
    return imitation


def variants() -> list[RobotVariant]:
    """Return the rows of the certificate that are played."""
    every = certificate_variants(paper_model(), "planar", opponent_for("normal"))
    return [one for one in every if one.name in ROWS]


def rows(student: Student, episodes: int) -> dict[str, float]:
    """Return the success on each of `ROWS`."""
    found = {}
    for one in variants():
        won = successes(
            student,
            range(episodes),
            model=one.model,
            opponent=one.opponent,
            senses=one.senses,
            engine="arrays",
        )
        found[one.name] = float(won.mean())
    return found


@dataclass(frozen=True)
class Plan:
    """Sizes of the comparison; what was measured with others is not mixed with it."""

    steps: int
    passes: int
    episodes: int


def measure(out: Path, seeds: Sequence[int], plan: Plan) -> dict[str, Any]:
    """Return what is in `out` after all seeds are in it, which is what is measured here.

    Raises:
        InputError: the file was written with other sizes.
    """
    found: dict[str, Any] = {"plan": asdict(plan), "commit": commit() or "unknown", "planner": {}, "runs": {}}
    if out.exists():
        found = read_json(out)
        if found.get("plan") != asdict(plan):
            raise InputError(f"{out}: of other sizes ({found.get('plan')}); name another --out")
    for seed in seeds:
        if all(str(seed) in found["runs"].get(way, {}) for way in WAYS):
            continue
        begun = time.process_time()
        imitation = advice_of(seed, plan.steps)
        print(f"seed {seed}: advice after {_minutes(begun):.1f} processor minutes", flush=True)
        for way in WAYS:
            begun = time.process_time()
            student = fit(way, imitation, plan.passes, seed)
            spent = _minutes(begun)
            won = rows(student, plan.episodes)
            found["runs"].setdefault(way, {})[str(seed)] = {"rows": won, "fit_minutes": spent}
            write_json(out, found)
            print(f"seed {seed}, {way}: {np.mean(list(won.values())):.3f}", flush=True)
    for one in variants():
        if one.name not in found["planner"]:
            found["planner"][one.name] = play("told", one, plan.episodes)["won"] / plan.episodes
            write_json(out, found)
    return found


def about(plan: Plan) -> str:
    """Return how the networks were fitted, in words."""
    return (
        f"For each seed the planner's advice in {plan.steps:,} steps is collected once, on drawn robots and "
        "against drawn opponents with plain sensors. Four networks are fitted to this same advice, each in "
        f"{plan.passes} passes: two hidden layers of {_UNITS} units on the last 2, 6 or 16 observations, and "
        f"one gated recurrent layer with a state of {_UNITS} that reads the sixteen one after the other. In "
        "collecting, the network of 16 observations drives, so the states are those that it meets. Each then "
        f"plays {plan.episodes} episodes of each row of a [certificate](../certify.md), the same for all."
    )


def _minutes(begun: float) -> float:
    return (time.process_time() - begun) / 60.0


def main(
    out: Path = Path("out/bench/learning.json"),
    seeds: tuple[int, ...] = (0, 1, 2),
    steps: int = 72_000,
    passes: int = 24,
    episodes: int = 200,
    markdown: Path | None = None,
) -> None:
    """Compare how much of the past students of the planner see.

    Example: python benchmarks/learning.py --markdown docs/results/learning.md

    Args:
        out: JSON file to write; what is in it already is not done again.
        seeds: Seeds of the advice and of the weights.
        steps: Steps with advice for each seed.
        passes: Passes over the advice.
        episodes: Number of episodes of each row, with the seeds 0, 1, ...
        markdown: Markdown file to write the page to.
    """
    torch.set_num_threads(1)
    plan = Plan(steps, passes, episodes)
    print_page(page(measure(out, seeds, plan), WAYS, about(plan)), markdown)


if __name__ == "__main__":
    raise SystemExit(run(main, prog="python benchmarks/learning.py"))
