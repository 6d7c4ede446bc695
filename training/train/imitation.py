"""Imitation of the planner `mpc`: episodes with its advice, and the network that is fitted to it.

The planner is told the true robot and the true opponent of each episode, and sees through plain sensors. The
network is told neither and sees more observations, through each kind of senses that it is trained for: all of
them watch the same episodes, so that one piece of advice serves them all. It learns in rounds: in the first
the planner drives, in the others mostly the network itself, with noise, while the planner says what it would
do (dataset aggregation: S. Ross, G. Gordon and D. Bagnell, "A reduction of imitation learning and structured
prediction to no-regret online learning", AISTATS 2011).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt
import torch

from mecanum_env.tankendo.actions import FULL_V_RPM, FULL_VC_RPM, action_to_command
from mecanum_env.tankendo.vector import TankendoVectorEnv
from mecanum_env.units import FloatArray
from training.controllers.features import features, stack_features
from training.controllers.interface import Command
from training.controllers.mpc import Mpc
from training.controllers.policy import Network
from training.train.environments import model_of, opponents_of, senses_of
from training.train.mirror import ACTION_SIGNS, FEATURE_SIGNS
from training.train.robots import varied_models
from training.train.settings import TrainingSettings

_NOISY: Final = 0.3
"""Share of the actions that are noisy."""
_ROBOTS: Final = 96
_BATCH, _RATE = 1024, 2e-3
_HUBER: Final = 0.05
"""Errors of an action beyond this count linearly. The planner goes at once or not yet, to one side or the
other: then the median is what it most often does, and the mean is neither."""
_SHORT: Final = 0.4
"""Half of the episodes have a warning within this share of its range, from the shortest on: there a tenth of
a second decides, and a long warning is learnt from few."""
_STRIKE_WEIGHT: Final = 4.0
"""Weight of a state in which the sword has risen: these decide, and they are few."""
_DECISIVE: Final = 1.5
"""Factor on the advice in such a state. Robots do no more than full speed, so advice to go stays what it is,
and what is torn between going and waiting goes: it would else be hesitant, and late."""
_CLIP: Final = 10.0
_FIRST_SEED: Final = 2**41
"""Seeds of the episodes begin here, above those of `episode_seeds`."""


class Imitation:
    """Episodes with the planner's advice, and the network that is fitted to it."""

    def __init__(self, settings: TrainingSettings) -> None:
        self._settings, self._rng = settings, np.random.default_rng(settings.seed)
        torch.manual_seed(settings.seed)
        kinds = senses_of(settings)
        self._is_plain = [senses is None for senses in kinds]
        low, high = settings.warning_s
        robots = varied_models(model_of(settings), settings.latency_s, _ROBOTS, self._rng)
        self._envs = [
            TankendoVectorEnv(
                settings.envs,
                autoreset_mode="Disabled",
                engine="arrays",
                opponent=opponents_of(replace(settings, warning_s=warning_s), settings.steps),
                randomize=robots,
                model=model_of(settings),
                senses=next((senses for senses in kinds if senses is not None), None),
            )
            for warning_s in ((low, low + _SHORT * (high - low)), (low, high))
        ]
        self._layers: torch.nn.Sequential | None = None
        self._scale = np.ones(0)
        self._seen: list[npt.NDArray[np.float32]] = []
        self._advice: list[npt.NDArray[np.float32]] = []
        self._weights: list[npt.NDArray[np.float32]] = []

    def collect(self, steps: int, planner_share: float, noise: float) -> None:
        """Play a number of `steps` of all environments together, and keep what was seen and advised.

        The planner drives the share `planner_share` of the episodes, and the actions have `noise` of this
        standard deviation.
        """
        for env in self._envs:
            self._collect_in(env, steps // len(self._envs), planner_share, noise)

    def _collect_in(self, env: TankendoVectorEnv, steps: int, planner_share: float, noise: float) -> None:
        rng, rows, arena = self._rng, env.num_envs, env.arena
        network = None if self._layers is None else self.network()
        env.reset(seed=self._seeds())
        begun, planner, kind = np.ones(rows, bool), np.ones(rows, bool), np.zeros(rows, np.intp)
        advisers = [Mpc(model_of(self._settings))] * rows
        memories: list[FloatArray] | None = None
        for _ in range(max(steps // rows, 1)):
            for row in np.flatnonzero(begun).tolist():
                robot, opponent = arena.robots.model_of(row), arena.fighter.opponents[row]
                advisers[row] = Mpc(robot, opponent=opponent, is_exact=True)
            planner = np.where(begun, rng.random(rows) < planner_share, planner)
            # Through which senses the network sees when it drives.
            kind = np.where(begun, rng.integers(len(self._is_plain), size=rows), kind)
            shown = arena.observe_plainly()
            memories = self._remembered(memories, (shown, arena.observed), begun)
            advice = np.array(
                [_as_action(one.advise(seen)) for one, seen in zip(advisers, shown, strict=True)]
            )
            risen = np.array([one.sees_strike for one in advisers])
            wanted = np.where(risen[:, None], _DECISIVE * advice, advice)
            for memory in memories:
                self._seen.append(memory.astype(np.float32))
                self._advice.append(wanted.astype(np.float32))
                self._weights.append(np.where(risen, _STRIKE_WEIGHT, 1.0).astype(np.float32))
            acted = advice
            if network is not None:
                own = network.actions(np.stack(memories)[kind, np.arange(rows)])
                acted = np.where(planner[:, None], advice, own)
            disturbed = rng.random((rows, 1)) < _NOISY
            acted = np.clip(acted + disturbed * noise * rng.standard_normal((rows, 3)), -1.0, 1.0)
            for one, sent in zip(advisers, action_to_command(acted, "cartesian"), strict=True):
                one.sent((round(float(sent[0])), round(float(sent[1])), round(float(sent[2]))))
            result = arena.step(acted.astype(np.float32))
            begun = result.terminated | result.truncated
            if begun.any():
                env.reset(seed=self._seeds(), options={"reset_mask": begun})

    def _remembered(
        self,
        before: list[FloatArray] | None,
        shown: tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]],
        begun: npt.NDArray[np.bool_],
    ) -> list[FloatArray]:
        """Return the stacked features through each kind of senses, given those `before`.

        Plain sensors and the others show what is in `shown`; some episodes have just `begun`.
        """
        memories, stack = [], self._settings.stack
        for number, is_plain in enumerate(self._is_plain):
            newest = features(shown[0] if is_plain else shown[1])
            first = stack_features(None, newest, stack)
            memory = first if before is None else stack_features(before[number], newest, stack)
            memory[begun] = first[begun]
            memories.append(memory)
        return memories

    def samples(self) -> tuple[npt.NDArray[np.float32], ...]:
        """Return all advice until now: stacked features (m, k), actions (m, 3), and weights (m,)."""
        parts = self._seen, self._advice, self._weights
        return tuple(np.concatenate(part) for part in parts)

    def fit(self, epochs: int) -> float:
        """Fit the network to all advice until now in `epochs` passes; return the mean error of the last.

        Every other pass is over the mirrored states.
        """
        samples = self.samples()
        seen, advice, _ = samples
        if self._layers is None:
            # Of the states and their mirror images, whose mean is near 0.
            self._scale = scale_of(seen)
            self._layers = new_layers((seen.shape[1], *self._settings.ppo.layers, advice.shape[1]))
        return fit_to_advice(self._layers, self._layers.parameters(), samples, self._scale, epochs)

    def network(self) -> Network:
        """Return the network as it is fitted."""
        assert self._layers is not None
        linear = [layer for layer in self._layers if isinstance(layer, torch.nn.Linear)]
        return Network(
            mean=np.zeros(len(self._scale)),
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
        return _FIRST_SEED + self._rng.integers(2**40, size=self._settings.envs)


def scale_of(seen: npt.NDArray[np.float32]) -> FloatArray:
    """Return the root mean square of each of the features `seen`, (m, k), by which networks divide them."""
    return np.asarray(np.sqrt(np.mean(np.square(seen.astype(float)), axis=0)) + 1e-3)


def scaled(seen: npt.NDArray[np.floating], scale: FloatArray) -> torch.Tensor:
    """Return the features `seen` (m, k) over their `scale` (k,), clipped, as networks see them."""
    over = torch.tensor(seen, dtype=torch.float32) / torch.tensor(scale, dtype=torch.float32)
    return over.clamp(-_CLIP, _CLIP)


def new_layers(sizes: Sequence[int]) -> torch.nn.Sequential:
    """Return linear layers of these sizes with tanh between them."""
    layers: list[torch.nn.Module] = []
    for inputs, outputs in itertools.pairwise(sizes):
        layers += [torch.nn.Linear(inputs, outputs), torch.nn.Tanh()]
    return torch.nn.Sequential(*layers[:-1])


def fit_to_advice(
    act: Callable[[torch.Tensor], torch.Tensor],
    parameters: Iterable[torch.nn.Parameter],
    samples: tuple[npt.NDArray[np.float32], ...],
    scale: FloatArray,
    epochs: int,
) -> float:
    """Fit a network to advice in `epochs` passes, every other one over the mirrored states.

    Args:
        act: the network: scaled features (n, k) to actions (n, 3).
        parameters: its parameters.
        samples: features (m, k), advice (m, 3) and weights (m,), as `Imitation.samples` returns them.
        scale: what the features are divided by, (k,).
        epochs: number of passes.

    Returns:
        The weighted mean error of the last pass.
    """
    seen, advice, given = samples
    x, y, weights = scaled(seen, scale), torch.tensor(advice), torch.tensor(given)
    stack = seen.shape[1] // len(FEATURE_SIGNS)
    feature_signs = torch.tensor(np.tile(FEATURE_SIGNS, stack), dtype=torch.float32)
    action_signs = torch.tensor(ACTION_SIGNS, dtype=torch.float32)
    optimiser = torch.optim.Adam(parameters, lr=_RATE)
    falling = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, epochs)
    total = 0.0
    for epoch in range(epochs):
        total = 0.0
        for batch in torch.randperm(len(x)).split(_BATCH):
            shown, wanted = x[batch], y[batch]
            if epoch % 2:
                shown, wanted = shown * feature_signs, wanted * action_signs
            errors = torch.nn.functional.smooth_l1_loss(act(shown), wanted, beta=_HUBER, reduction="none")
            error = (weights[batch] * errors.mean(dim=1)).mean()
            optimiser.zero_grad()
            error.backward()
            optimiser.step()
            total += float(error.item()) * len(batch)
        falling.step()
    return total / len(x)


def _as_action(command: Command) -> FloatArray:
    """Return the Cartesian action of a command, shape (3,)."""
    v, theta, vc = command
    angle = np.deg2rad(theta)
    return np.array([v * np.cos(angle) / FULL_V_RPM, v * np.sin(angle) / FULL_V_RPM, vc / FULL_VC_RPM])
