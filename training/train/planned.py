"""A policy that imitates the planner `mpc`: `python -m training.train.planned --out FOLDER`.

The planner is told the true robot and the true opponent of each episode; the policy sees neither, but more
observations. It learns in rounds: in the first the planner drives, in the others mostly the policy itself,
with noise, while the planner says what it would do (dataset aggregation, see `taught`). The planner waits for
the strike, whenever it comes, and so does what imitates it; PPO, which begins by moving as soon as the sword
does, hardly finds that. The result is a teacher for `python -m training.train --teacher FOLDER`.
"""

from __future__ import annotations

import itertools
import sys
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
import torch
from tqdm import tqdm

from mecanum_env.cli import run
from mecanum_env.errors import require_at_least
from mecanum_env.outputs import output_folder
from mecanum_env.programs import Done
from mecanum_env.tankendo.actions import FULL_V_RPM, FULL_VC_RPM, action_to_command
from mecanum_env.tankendo.vector import TankendoVectorEnv
from mecanum_env.units import FloatArray
from training.controllers.interface import Command
from training.controllers.mpc import Mpc
from training.controllers.policy import Network, features, save_policy, stack_features
from training.train.checkpoint import about
from training.train.environments import model_of, opponents_of
from training.train.robots import varied_models
from training.train.settings import TrainingSettings

ROUNDS: Final = ((1.0, 0.5), (0.4, 0.3), (0.2, 0.2), (0.1, 0.1))
"""Share of the episodes that the planner drives, and standard deviation of the noise on actions, by round."""
_NOISY: Final = 0.3
"""Share of the actions that are noisy."""
_ROBOTS: Final = 24
_EPOCHS, _BATCH, _RATE = 40, 512, 1.5e-3
_HUBER: Final = 0.2
"""Errors of an action beyond this count linearly: the planner may choose either side."""
_CLIP: Final = 10.0
_FIRST_SEED: Final = 2**41
"""Seeds of the episodes begin here, above those of `episode_seeds`."""


class Imitation:
    """Episodes with the planner's advice, and the network that is fitted to it."""

    def __init__(self, settings: TrainingSettings, rows: int) -> None:
        self._settings, self._rng = settings, np.random.default_rng(settings.seed)
        torch.manual_seed(settings.seed)
        robots = varied_models(model_of(settings), settings.latency_s, _ROBOTS, self._rng)
        self._env = TankendoVectorEnv(
            rows,
            autoreset_mode="Disabled",
            engine="arrays",
            opponent=opponents_of(settings, settings.steps),
            randomize=robots,
            model=model_of(settings),
        )
        self._layers: torch.nn.Sequential | None = None
        self._mean, self._scale = np.zeros(0), np.zeros(0)
        self.seen: list[FloatArray] = []
        self.advice: list[FloatArray] = []

    def collect(self, steps: int, planner_share: float, noise: float) -> None:
        """Play a number of `steps` of all rows together, and keep what was seen and advised.

        The planner drives the share `planner_share` of the episodes, and the actions have `noise` of this
        standard deviation.
        """
        env, rng, rows = self._env, self._rng, self._env.num_envs
        arena = env.arena
        observation, _ = env.reset(seed=self._seeds())
        begun, planner = np.ones(rows, bool), np.ones(rows, bool)
        advisers: list[Mpc] = []
        memory = np.zeros(0)
        for step in range(max(steps // rows, 1)):
            newest = features(observation)
            first = stack_features(None, newest, self._settings.stack)
            memory = first if step == 0 else stack_features(memory, newest, self._settings.stack)
            memory[begun] = first[begun]
            for row in np.flatnonzero(begun).tolist():
                robot, opponent = arena.robots.model_of(row), arena.fighter.opponents[row]
                advisers[row : row + 1] = [Mpc(robot, opponent=opponent)]
                planner[row] = rng.random() < planner_share
            advice = np.array(
                [_as_action(one.advise(seen)) for one, seen in zip(advisers, observation, strict=True)]
            )
            self.seen.append(memory.copy())
            self.advice.append(advice)
            acted = (
                advice
                if self._layers is None
                else np.where(planner[:, None], advice, self.network().actions(memory))
            )
            disturbed = rng.random((rows, 1)) < _NOISY
            acted = np.clip(acted + disturbed * noise * rng.standard_normal((rows, 3)), -1.0, 1.0)
            for one, sent in zip(advisers, action_to_command(acted, "cartesian"), strict=True):
                one.sent((round(float(sent[0])), round(float(sent[1])), round(float(sent[2]))))
            result = arena.step(acted.astype(np.float32))
            observation, begun = result.observation, result.terminated | result.truncated
            if begun.any():
                observation, _ = env.reset(seed=self._seeds(), options={"reset_mask": begun})

    def fit(self) -> float:
        """Fit the network to all advice until now; return the last batch's error."""
        seen, advice = np.concatenate(self.seen), np.concatenate(self.advice)
        self._mean, self._scale = seen.mean(axis=0), seen.std(axis=0) + 1e-4
        x = torch.tensor((seen - self._mean) / self._scale, dtype=torch.float32).clamp(-_CLIP, _CLIP)
        y = torch.tensor(advice, dtype=torch.float32)
        if self._layers is None:
            sizes = (x.shape[1], *self._settings.ppo.layers)
            hidden = [
                part
                for n, m in itertools.pairwise(sizes)
                for part in (torch.nn.Linear(n, m), torch.nn.Tanh())
            ]
            self._layers = torch.nn.Sequential(*hidden, torch.nn.Linear(sizes[-1], y.shape[1]))
        optimiser = torch.optim.Adam(self._layers.parameters(), lr=_RATE)
        falling = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, _EPOCHS)
        error = torch.zeros(())
        for _ in range(_EPOCHS):
            for batch in torch.randperm(len(x)).split(_BATCH):
                error = torch.nn.functional.smooth_l1_loss(self._layers(x[batch]), y[batch], beta=_HUBER)
                optimiser.zero_grad()
                error.backward()
                optimiser.step()
            falling.step()
        return float(error.item())

    def network(self) -> Network:
        """Return the network as it is fitted."""
        assert self._layers is not None
        linear = [layer for layer in self._layers if isinstance(layer, torch.nn.Linear)]
        return Network(
            mean=self._mean,
            scale=self._scale,
            clip=_CLIP,
            weights=tuple(layer.weight.detach().numpy().astype(float) for layer in linear),
            biases=tuple(layer.bias.detach().numpy().astype(float) for layer in linear),
            activation="tanh",
            squashes=False,
            action_mode="cartesian",
            stack=self._settings.stack,
        )

    def _seeds(self) -> npt.NDArray[np.int64]:
        return _FIRST_SEED + self._rng.integers(2**40, size=self._env.num_envs)


def _as_action(command: Command) -> FloatArray:
    """Return the Cartesian action of a command, shape (3,)."""
    v, theta, vc = command
    angle = np.deg2rad(theta)
    return np.array([v * np.cos(angle) / FULL_V_RPM, v * np.sin(angle) / FULL_V_RPM, vc / FULL_VC_RPM])


def main(
    out: Path,
    model: Path | None = None,
    seed: int = 0,
    stack: int = 6,
    steps: int = 48_000,
    rows: int = 24,
) -> Done:
    """Fit a policy to the planner's advice on drawn robots, against drawn opponents.

    Example: python -m training.train.planned --out out/planned

    Args:
        out: Folder to write: policy.npz.
        model: Model file of the robot; by default the packaged one.
        seed: Seed of robots, episodes and weights.
        stack: Number of observations that the policy sees.
        steps: Steps with advice, of all rounds and rows together.
        rows: Number of episodes side by side.
    """
    require_at_least(1, steps=steps, rows=rows)
    settings = TrainingSettings(
        seed=seed,
        stack=stack,
        steps=steps,
        envs=rows,
        model=None if model is None else str(model),
        randomize="varied",
        opponents="varied",
        curriculum=0.0,
    )
    torch.set_num_threads(1)
    imitation = Imitation(settings, rows)
    for share, noise in tqdm(ROUNDS, desc="rounds", disable=None):
        imitation.collect(steps // len(ROUNDS), share, noise)
        error = imitation.fit()
    command = f"python -m training.train.planned --out {out} --seed {seed} --stack {stack} --steps {steps}"
    with output_folder(out, "training.train.planned", ("policy.npz",)) as staged:
        save_policy(staged / "policy.npz", imitation.network(), about(settings, steps, [command]))
    print(f"error of an action {error:.4f}\nwrote {out / 'policy.npz'}")
    return Done(wrote=[out / "policy.npz"])


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m training.train.planned"))
