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
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from mecanum_env.errors import InputError
from training.controllers.policy import Network, bundled, load_network, policy_path
from training.train.actor_critic import PredictingPolicy, StateDependentStdPolicy
from training.train.privileged import PRIVILEGED
from training.train.rollout import RolloutOnDevice
from training.train.settings import TrainingSettings
from training.train.taught import TaughtPpo

_ACTIVATIONS: Final = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU}


def make_agent(settings: TrainingSettings, env: VecEnv) -> BaseAlgorithm:
    """Return a learner in `env` with new weights, drawn from the settings' seed.

    Raises:
        InputError: the settings ask for a GPU that this PyTorch does not find, or as of `teacher_of`.
    """
    if settings.device == "cuda" and not torch.cuda.is_available():
        raise InputError(
            f"device = cuda: PyTorch {torch.__version__} finds no GPU here; give cpu, or install another"
        )
    torch.set_num_threads(settings.threads)
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
    kind: type[StateDependentStdPolicy] = StateDependentStdPolicy
    weights: dict[str, Any] = {}
    entropy_weight = ppo.entropy_weight
    if ppo.prediction_weight > 0.0:
        # The policy weighs entropy and prediction itself, and PPO adds what it says as it is.
        kind, entropy_weight = PredictingPolicy, 1.0
        weights = {"entropy_weight": ppo.entropy_weight, "prediction_weight": ppo.prediction_weight}
    return learner(
        kind,
        env,
        n_steps=ppo.rollout_steps,
        rollout_buffer_class=RolloutOnDevice,
        batch_size=min(ppo.batch_size, ppo.rollout_steps * settings.envs),
        n_epochs=ppo.epochs,
        gamma=ppo.gamma,
        gae_lambda=ppo.gae_lambda,
        clip_range=ppo.clip_range,
        ent_coef=entropy_weight,
        policy_kwargs={
            "net_arch": {"pi": list(ppo.layers), "vf": list(ppo.layers)},
            "seen": seen if seen < size else None,
            "activation_fn": _ACTIVATIONS[ppo.activation],
            "log_std_init": ppo.log_std,
            **weights,
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
    if network.has_time_to_cut != settings.time_to_cut:
        sees = "sees" if network.has_time_to_cut else "does not see"
        raise InputError(f"teacher {name}: {sees} the time to the cut; give its student the same")
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
        has_time_to_cut=settings.time_to_cut,
    )
