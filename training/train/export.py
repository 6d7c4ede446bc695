"""Exporting a policy: from the learner to a network that needs NumPy alone, with what it was made with."""

from __future__ import annotations

import platform
import subprocess
from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecNormalize

from mecanum_env.model import Model, model_to_dict
from mecanum_env.units import FloatArray
from training.controllers.policy import Network
from training.train.settings import TrainingSettings

_PACKAGES: Final = ("mecanum-tankendo", "mujoco", "gymnasium", "stable-baselines3", "torch", "numpy")
_ACTIVATION_NAMES: Final = {torch.nn.Tanh: "tanh", torch.nn.ReLU: "relu"}


def network_of(agent: BaseAlgorithm, normaliser: VecNormalize, settings: TrainingSettings) -> Network:
    """Return the deterministic policy of an agent, PPO or SAC, with the normaliser of its observations."""
    if settings.algo == "ppo":
        layers = [*agent.policy.mlp_extractor.policy_net, agent.policy.action_net]
    else:
        layers = [*agent.policy.actor.latent_pi, agent.policy.actor.mu]
    linear = [layer for layer in layers if isinstance(layer, torch.nn.Linear)]
    between = {_ACTIVATION_NAMES[type(layer)] for layer in layers if type(layer) in _ACTIVATION_NAMES}
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


def _numbers(tensor: torch.Tensor) -> FloatArray:
    return np.array(tensor.detach().cpu().numpy(), float)


def about(
    settings: TrainingSettings, model: Model, steps_done: int, commands: Sequence[str]
) -> dict[str, Any]:
    """Return the description in a policy file: of a policy trained by these commands, with `steps_done`."""
    whole = model_to_dict(model)
    return {
        "env": settings.env,
        "steps_done": steps_done,
        "commands": list(commands),
        "settings": asdict(settings),
        "model": {
            "source": "the packaged model" if settings.model is None else settings.model,
            "provenance": whole.get("provenance", {}),
            "effects": whole.get("effects", {}),
        },
        "command_quantum_rpm": model.wheel.command_quantum_rpm,
        "versions": versions(),
    }


def versions() -> dict[str, str]:
    """Return the versions of Python and of the installed packages that a training depends on."""
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def commit() -> str | None:
    """Return the commit of the running checkout, with "+" if files differ from it; None outside of one."""
    root = Path(__file__).parents[2]
    head = _git(root, "rev-parse", "HEAD") if (root / ".git").exists() else None
    if head is None:
        return None
    return head + ("+" if _git(root, "status", "--porcelain", "--untracked-files=no") else "")


def _git(root: Path, *arguments: str) -> str | None:
    try:
        done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()
