"""The learner, Stable-Baselines3's PPO or SAC with the hyperparameters of a run, and its export to NumPy."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.distributions import Distribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import MlpExtractor
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from mecanum_env.errors import InputError
from training.controllers.policy import Network, bundled, load_network, policy_path
from training.train.privileged import PRIVILEGED
from training.train.rollout import RolloutOnDevice
from training.train.settings import TrainingSettings
from training.train.taught import TaughtPpo

_LOG_STD_RANGE: Final = (-4.0, 0.5)
_ACTIVATIONS: Final = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU}


class ActorSeesLess(MlpExtractor):  # type: ignore[misc]
    """The hidden layers of an actor that sees only the first `seen` of the numbers that its critic sees."""

    def __init__(self, feature_dim: int, seen: int, *args: Any, **kwargs: Any) -> None:
        super().__init__(feature_dim, *args, **kwargs)
        self._seen = seen
        self.policy_net = MlpExtractor(seen, *args, **kwargs).policy_net

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        """Return the last hidden layer of the actor for features, shape (n, all numbers)."""
        return self.policy_net(features[:, : self._seen])


class StateDependentStdPolicy(ActorCriticPolicy):  # type: ignore[misc]
    """PPO's policy with a standard deviation of the actions that is an output of the actor's network.

    The opponent strikes only at a slow robot, and noise that is large enough to discover evasions keeps the
    robot too fast to be struck at. One standard deviation for all states would have to be either.

    With `seen` the actor gets only the first `seen` numbers of an observation, and the critic all.
    """

    def __init__(self, *args: Any, seen: int | None = None, **kwargs: Any) -> None:
        self._seen = seen
        super().__init__(*args, **kwargs)

    def _build_mlp_extractor(self) -> None:
        if self._seen is None:
            super()._build_mlp_extractor()
            return
        self.mlp_extractor = ActorSeesLess(
            self.features_dim,
            self._seen,
            net_arch=self.net_arch,
            activation_fn=self.activation_fn,
            device=self.device,
        )

    def _build(self, lr_schedule: Callable[[float], float]) -> None:
        super()._build(lr_schedule)
        self.log_std_net = torch.nn.Linear(self.mlp_extractor.latent_dim_pi, self.action_space.shape[0])
        self.reset_std(self.log_std_init)
        self.log_std.requires_grad_(False)
        learned = [parameter for parameter in self.parameters() if parameter.requires_grad]
        self.optimizer = self.optimizer_class(learned, lr=lr_schedule(1.0), **self.optimizer_kwargs)

    def reset_std(self, log_std: float) -> None:
        """Give all states the same standard deviation, exp(`log_std`)."""
        torch.nn.init.zeros_(self.log_std_net.weight)
        torch.nn.init.constant_(self.log_std_net.bias, log_std)

    def _get_action_dist_from_latent(self, latent_pi: torch.Tensor) -> Distribution:
        log_std = self.log_std_net(latent_pi).clamp(*_LOG_STD_RANGE)
        # Only read by Stable-Baselines3, which logs it as train/std.
        self.log_std.data = log_std.detach().mean(dim=0)
        return self.action_dist.proba_distribution(self.action_net(latent_pi), log_std)


def make_agent(settings: TrainingSettings, env: VecEnv) -> BaseAlgorithm:
    """Return a learner in `env` with new weights, drawn from the settings' seed.

    Raises:
        InputError: the settings ask for a GPU that this PyTorch does not find, or as of `teacher_of`.
    """
    if settings.device == "cuda" and not torch.cuda.is_available():
        raise InputError(
            f"device = cuda: PyTorch {torch.__version__} finds no GPU here; give cpu, or install another"
        )
    # On networks this small more threads only wait for each other.
    torch.set_num_threads(1)
    common: Any = {
        "learning_rate": _learning_rate(settings),
        "seed": settings.seed,
        "device": settings.device,
    }
    if settings.algo == "sac":
        sac = settings.sac
        return SAC(
            "MlpPolicy",
            env,
            batch_size=sac.batch_size,
            buffer_size=sac.buffer_size,
            learning_starts=sac.learning_starts,
            train_freq=1,
            gradient_steps=sac.updates_a_step,
            gamma=sac.gamma,
            policy_kwargs={"net_arch": list(sac.layers), "activation_fn": _ACTIVATIONS[sac.activation]},
            **common,
        )
    ppo = settings.ppo
    size = env.observation_space.shape[0]
    features = size if settings.privileged == "none" else size - PRIVILEGED
    seen = features if settings.privileged == "critic" else size
    learner: Callable[..., PPO] = PPO
    if settings.teacher is not None:
        teacher = teacher_of(settings.teacher, settings)
        learner = partial(TaughtPpo, teacher=teacher, teacher_steps=settings.teacher_steps, features=features)
    return learner(
        StateDependentStdPolicy,
        env,
        n_steps=ppo.rollout_steps,
        rollout_buffer_class=RolloutOnDevice,
        batch_size=min(ppo.batch_size, ppo.rollout_steps * settings.envs),
        n_epochs=ppo.epochs,
        gamma=ppo.gamma,
        gae_lambda=ppo.gae_lambda,
        clip_range=ppo.clip_range,
        ent_coef=ppo.entropy_weight,
        policy_kwargs={
            "net_arch": {"pi": list(ppo.layers), "vf": list(ppo.layers)},
            "seen": seen if seen < size else None,
            "activation_fn": _ACTIVATIONS[ppo.activation],
            "log_std_init": ppo.log_std,
        },
        **common,
    )


def teacher_of(name: str, settings: TrainingSettings) -> Network:
    """Return the network of the teacher `name`: a file, a folder, or the name of a bundled policy.

    Raises:
        InputError: there is none, or it is not one that a run with these settings can imitate.
    """
    network, _ = load_network(teacher_path(name))
    if network.privileged and settings.privileged == "none":
        raise InputError(f"teacher {name}: sees privileged numbers; give --privileged critic or both")
    if network.stack > settings.stack or network.action_mode != settings.action_mode:
        raise InputError(
            f"teacher {name}: sees {network.stack} observations and acts in {network.action_mode}, the "
            f"student sees {settings.stack} and acts in {settings.action_mode}; give at least as long a "
            "--stack, and the same --action-mode"
        )
    return network


def teacher_path(name: str) -> Path:
    """Return the file or folder of the teacher `name`, or that of the bundled policy of this name."""
    return policy_path(name) or bundled(name)


def _learning_rate(settings: TrainingSettings) -> Callable[[float], float]:
    """Return the learning rate as a function of the remaining share of the steps: it falls linearly."""
    own = settings.ppo if settings.algo == "ppo" else settings.sac
    first, last = own.learning_rate, own.last_learning_rate
    return lambda left: last + (first - last) * left


def network_of(agent: BaseAlgorithm, normaliser: VecNormalize, settings: TrainingSettings) -> Network:
    """Return the deterministic policy of an agent, PPO or SAC, with the normaliser of its observations."""
    if settings.algo == "ppo":
        layers = [*agent.policy.mlp_extractor.policy_net, agent.policy.action_net]
    else:
        layers = [*agent.policy.actor.latent_pi, agent.policy.actor.mu]
    linear = [layer for layer in layers if isinstance(layer, torch.nn.Linear)]
    between = [name for name, kind in _ACTIVATIONS.items() if any(isinstance(one, kind) for one in layers)]
    # What the critic alone sees comes last.
    seen = linear[0].in_features
    return Network(
        mean=np.array(normaliser.obs_rms.mean[:seen]),
        scale=np.sqrt(normaliser.obs_rms.var[:seen] + normaliser.epsilon),
        clip=float(normaliser.clip_obs),
        weights=tuple(layer.weight.detach().cpu().numpy().astype(float) for layer in linear),
        biases=tuple(layer.bias.detach().cpu().numpy().astype(float) for layer in linear),
        activation=between[0] if between else "tanh",
        squashes=settings.algo == "sac",
        action_mode=settings.action_mode,
        stack=settings.stack,
        privileged=PRIVILEGED if settings.privileged == "both" else 0,
    )
