"""Self-play: a learner fights frozen scripts and its own past selves: `python -m training.duel.league`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import matplotlib
import numpy as np
import tyro
from matplotlib.figure import Figure
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

from mecanum_env.cli import run
from mecanum_env.errors import require_at_least
from mecanum_env.files import write_json
from mecanum_env.outputs import output_folder
from mecanum_env.programs import Done
from mecanum_env.units import FloatArray
from training.controllers.policy import Network, Policy, save_policy
from training.duel.elo import Ratings, fit_elo
from training.duel.environment import DuelVecEnv
from training.duel.match import Player, PlayerFactory, play_match, player_factory
from training.train.agent import make_agent, network_of
from training.train.settings import Ppo, TrainingSettings
from training.train.vec_env import StackedVecEnv

_REWARD: Final = {"out": 5.0}
"""Weights of the reward that differ from the environment's: leaving the field is no way out of a bout."""
_TRAINING_SEED: Final = 2**40
"""Training seeds are at least this, so that no bout of a match has been trained on."""
_ABOUT: Final = {"env": "MecanumTankendoDuel", "action_mode": "cartesian", "command_quantum_rpm": 1.0}


@dataclass(frozen=True)
class LeagueSettings:
    """A league: in each generation the learner fights all members of the pool, then joins it as it is."""

    generations: int = 6
    steps: int = 100_000
    """Steps of the learner in a generation, of all bouts together."""
    bouts: int = 40
    """Bouts of each new member against each older one."""
    envs: int = 64
    """Bouts side by side in training."""
    seed: int = 0
    scripts: tuple[str, ...] = ("retreat", "sidestep")
    """Controllers that are in the pool from the start; the first one is rated 0."""

    def __post_init__(self) -> None:
        numbers = ("generations", "steps", "bouts", "envs")
        require_at_least(1, **{name: getattr(self, name) for name in numbers})
        require_at_least(1, scripts=len(self.scripts))


@dataclass
class League:
    """Who has played in a league, and the results between them."""

    names: list[str]
    makers: list[PlayerFactory]
    scores: FloatArray
    """Wins, and half the draws, of each member against each other one, shape (n, n)."""
    played: FloatArray
    """Bouts between them, shape (n, n)."""
    selves: dict[str, Network]
    """The learner after each generation, by name."""

    def join(self, name: str, maker: PlayerFactory, bouts: int) -> None:
        """Let a new member, made by `maker`, fight a number of bouts against each older one."""
        n = len(self.names)
        self.names.append(name)
        self.makers.append(maker)
        self.scores, self.played = (np.pad(one, (0, 1)) for one in (self.scores, self.played))
        for other in range(n):
            score = bouts * play_match(maker, self.makers[other], bouts).score
            self.scores[n, other], self.scores[other, n] = score, bouts - score
            self.played[n, other] = self.played[other, n] = bouts

    def ratings(self) -> Ratings:
        """Return the ratings of all members."""
        return fit_elo(self.scores, self.played)


def play_league(settings: LeagueSettings) -> League:
    """Train a learner by self-play, generation by generation; return all members and results.

    Raises:
        InputError: a script that does not exist.
    """
    league = League([], [], np.zeros((0, 0)), np.zeros((0, 0)), {})
    for name in settings.scripts:
        league.join(name, player_factory(name), settings.bouts)
    total = settings.generations * settings.steps
    training = TrainingSettings(
        env="MecanumTankendoDuel-v0",
        steps=total,
        seed=settings.seed,
        envs=settings.envs,
        reward_weights=_REWARD,
        ppo=replace(Ppo(), gamma=0.97),
    )
    world = DuelVecEnv(settings.envs, league.makers, _TRAINING_SEED + settings.seed, reward_weights=_REWARD)
    normaliser = VecNormalize(
        VecMonitor(StackedVecEnv(world, training.stack)), gamma=training.ppo.gamma, clip_obs=10.0
    )
    agent = make_agent(training, normaliser)
    # `learn` knows the steps until the end of a generation; the learning rate falls over those of all.
    falling = agent.lr_schedule
    agent.lr_schedule = lambda _: falling(max(0.0, 1.0 - agent.num_timesteps / total))
    for generation in range(1, settings.generations + 1):
        agent.learn(settings.steps, reset_num_timesteps=generation == 1)
        network = network_of(agent, normaliser, training)
        name = f"self-{generation}"
        league.selves[name] = network
        league.join(name, _frozen(network), settings.bouts)
        world.pool = list(league.makers)
        elo = league.ratings()
        print(f"{name}: Elo {elo.elo[-1]:+.0f} (standard error {elo.error[-1]:.0f})", flush=True)
    return league


def _frozen(network: Network) -> PlayerFactory:
    return lambda _: Player(Policy(network, _ABOUT))


def draw_elo(names: Sequence[str], ratings: Ratings, steps: int) -> Figure:
    """Return a figure of the ratings of all selves, `steps` apart, with those of the scripts as lines.

    The `names` are those of the members, in the order of their `ratings`.
    """
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.subplots()
    selves = [i for i, name in enumerate(names) if name.startswith("self-")]
    thousands = steps / 1e3 * np.arange(1, len(selves) + 1)
    half = 1.96 * ratings.error[selves]
    axes.errorbar(thousands, ratings.elo[selves], yerr=half, marker="o", capsize=3, label="past selves, 95 %")
    for i, name in enumerate(names):
        if i not in selves:
            axes.axhline(ratings.elo[i], color="0.5", linestyle="--", linewidth=1.0)
            axes.annotate(name, (0.0, ratings.elo[i]), (4, 3), textcoords="offset points", color="0.4")
    axes.set(xlabel="steps, thousands", ylabel="Elo", xlim=(0.0, None))
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right")
    return figure


def main(
    settings: tyro.conf.OmitArgPrefixes[LeagueSettings] = LeagueSettings(),
    out: Path = Path("league"),
) -> Done:
    """Train a policy by self-play against scripts and its past selves, and rate them all.

    Example: python -m training.duel.league --generations 6 --steps 100000 --out league

    Args:
        settings: The league.
        out: Folder to write: a policy for each past self, league.json and elo.png.
    """
    matplotlib.use("Agg")
    league = play_league(settings)
    ratings = league.ratings()
    found: dict[str, Any] = {
        "format": "mecanum-league/1",
        "names": league.names,
        "elo": ratings.elo.tolist(),
        "error": ratings.error.tolist(),
        "scores": league.scores.tolist(),
        "bouts": league.played.tolist(),
    }
    names = [*(f"{name}.npz" for name in league.selves), "elo.png", "league.json"]
    with output_folder(out, "training.duel.league", tuple(names)) as staged:
        for name, network in league.selves.items():
            save_policy(staged / f"{name}.npz", network, _ABOUT)
        draw_elo(league.names, ratings, settings.steps).savefig(staged / "elo.png", dpi=120)
        write_json(staged / "league.json", found)
    for name, elo, error in zip(league.names, ratings.elo, ratings.error, strict=True):
        print(f"{name:10}  {elo:+6.0f} +- {1.96 * error:.0f}")
    return Done(wrote=[out / name for name in reversed(names)])


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m training.duel.league"))
