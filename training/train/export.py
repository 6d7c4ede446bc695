"""From a learner to a policy file that needs numpy alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecNormalize

from mecanum_env.model import Model, model_to_dict
from mecanum_env.units import FloatArray
from training.controllers.policy import Network
from training.train.provenance import versions
from training.train.settings import Settings, settings_json

_NAMES = {torch.nn.Tanh: "tanh", torch.nn.ReLU: "relu"}


def network_of(agent: BaseAlgorithm, normaliser: VecNormalize, settings: Settings) -> Network:
    """Return the learner's deterministic policy.

    Args:
        agent: PPO or SAC.
        normaliser: of its observations.
        settings: of the run.
    """
    if settings.algo == "ppo":
        layers = [*agent.policy.mlp_extractor.policy_net, agent.policy.action_net]
    else:
        layers = [*agent.policy.actor.latent_pi, agent.policy.actor.mu]
    linear = [layer for layer in layers if isinstance(layer, torch.nn.Linear)]
    between = {_NAMES[type(layer)] for layer in layers if type(layer) in _NAMES}
    return Network(
        mean=np.array(normaliser.obs_rms.mean),
        scale=np.sqrt(normaliser.obs_rms.var + normaliser.epsilon),
        clip=float(normaliser.clip_obs),
        weights=tuple(_numbers(layer.weight) for layer in linear),
        biases=tuple(_numbers(layer.bias) for layer in linear),
        activation=between.pop() if between else "tanh",
        squashes=settings.algo == "sac",
        action_mode=settings.action_mode,
        stack=settings.stack,
    )


def about(settings: Settings, model: Model, steps_done: int, commands: Sequence[str]) -> dict[str, Any]:
    """Return what a policy file says of itself.

    Args:
        settings: of the run.
        model: that was trained on, or around.
        steps_done: of the training, so far.
        commands: that train it, oldest first.
    """
    whole = model_to_dict(model)
    return {
        "env": settings.env,
        "steps_done": steps_done,
        "commands": list(commands),
        "settings": settings_json(settings),
        "model": {
            "source": "the packaged model" if settings.model is None else settings.model,
            "provenance": whole.get("provenance", {}),
            "effects": whole.get("effects", {}),
        },
        "command_quantum_rpm": model.wheel.command_quantum_rpm,
        "versions": versions(),
    }


def _numbers(tensor: torch.Tensor) -> FloatArray:
    return np.array(tensor.detach().cpu().numpy(), float)
