"""A training folder, with checkpoints that are there whole or not at all.

run.json                settings, versions, commit and commands
curve.json              success on the development seeds at each checkpoint
policy.npz              the newest policy, for `training.controllers.policy.load_policy`
tensorboard/            for `tensorboard --logdir FOLDER`
checkpoints/000250000/  agent.zip (Stable-Baselines3), normaliser.pkl (VecNormalize), policy.npz,
                        state.json, and SAC's replay.pkl, in the newest only
"""

from __future__ import annotations

import json
import os
import pickle
import platform
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final

from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from mecanum_env.errors import InputError
from mecanum_env.files import write_json
from mecanum_env.model import model_to_dict
from training.controllers.policy import save_policy
from training.train.agent import StateDependentStdPolicy, network_of, read_agent
from training.train.environments import model_of
from training.train.settings import TrainingSettings, settings_from_json

_PACKAGES: Final = ("mecanum-tankendo", "mujoco", "gymnasium", "stable-baselines3", "torch", "numpy")


@dataclass(frozen=True)
class Point:
    """One point of the learning curve."""

    steps: int
    success: float
    """Share of successes of the deterministic policy on the development seeds, over all robots."""
    worst: float
    """The same on the worst robot; with one robot equal to `success`."""
    wall_s: float
    """Training time until now by the clock [s]."""
    processor_s: float
    """Training time until now by the processor [s]: the time that it takes on an idle machine."""


@dataclass(frozen=True)
class State:
    """How far a run has come."""

    steps_done: int = 0
    curve: tuple[Point, ...] = ()
    wall_s: float = 0.0
    processor_s: float = 0.0


@dataclass
class Run:
    """A training run."""

    settings: TrainingSettings
    folder: Path
    commands: Sequence[str]
    """Commands that train the policy: those of the runs that it started from, then its own."""
    agent: BaseAlgorithm
    normaliser: VecNormalize
    state: State


def write_checkpoint(run: Run) -> None:
    """Write a checkpoint of a run, then `policy.npz` and `curve.json` in its folder."""
    folder, agent, settings = run.folder, run.agent, run.settings
    target = folder / "checkpoints" / f"{run.state.steps_done:09d}"
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(dir=target.parent, prefix=".writing-"))
    try:
        agent.save(temporary / "agent.zip")
        run.normaliser.save(str(temporary / "normaliser.pkl"))
        if settings.algo == "sac":
            agent.save_replay_buffer(temporary / "replay.pkl")
        network = network_of(agent, run.normaliser, settings)
        facts = about(settings, run.state.steps_done, run.commands)
        save_policy(temporary / "policy.npz", network, facts)
        write_json(temporary / "state.json", asdict(run.state))
        temporary.chmod(0o755)
        if target.exists():
            shutil.rmtree(target)
        os.replace(temporary, target)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    for older in target.parent.glob("*/replay.pkl"):
        if older.parent != target:
            older.unlink()
    save_policy(folder / "policy.npz", network, facts)
    write_json(folder / "curve.json", [asdict(point) for point in run.state.curve])


def write_run(folder: Path, settings: TrainingSettings, facts: dict[str, Any]) -> None:
    """Write `run.json` with the settings of a run and other facts: versions, commit and commands."""
    write_json(folder / "run.json", {"settings": asdict(settings), **facts})


def read_run(folder: Path) -> tuple[TrainingSettings, dict[str, Any]]:
    """Return a run's settings and the remaining entries of `run.json` in its folder.

    Raises:
        InputError: the folder is no training folder.
    """
    path = folder / "run.json"
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        settings = settings_from_json(stored.pop("settings"))
        list(stored["commands"])
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    except OSError as error:
        raise InputError(
            f"{path}: {error.strerror}; give the folder of `python -m training.train`"
        ) from error
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{path}: not written by `python -m training.train`, or changed since; give another folder"
        ) from error
    return settings, stored


def newest_checkpoint(folder: Path) -> Path | None:
    """Return the newest checkpoint of the run in a folder; None if it has none."""
    return max((folder / "checkpoints").glob("[0-9]*"), default=None)


def read_state(checkpoint: Path) -> State:
    """Return the state of the run at a checkpoint.

    Raises:
        InputError: it cannot be read.
    """
    path = checkpoint / "state.json"
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        stored["curve"] = tuple(Point(**point) for point in stored["curve"])
        return State(**stored)
    except (OSError, KeyError, TypeError, json.JSONDecodeError) as error:
        raise InputError(f"{path}: not the state of a checkpoint ({error!r})") from error


def read_learner(
    checkpoint: Path, settings: TrainingSettings, env: VecEnv
) -> tuple[BaseAlgorithm, VecNormalize]:
    """Return learner and normaliser of a checkpoint, with `env` to learn in.

    Stable-Baselines3's files are pickled: open only your own.

    Raises:
        InputError: the checkpoint cannot be read.
    """
    try:
        normaliser = VecNormalize.load(str(checkpoint / "normaliser.pkl"), env)
        agent = read_agent(settings, normaliser, checkpoint / "agent.zip")
        if settings.algo == "sac":
            agent.load_replay_buffer(checkpoint / "replay.pkl")
    except (OSError, ValueError) as error:
        raise InputError(f"{checkpoint}: the checkpoint cannot be read ({error})") from error
    return agent, normaliser


def load_weights(folder: Path, agent: BaseAlgorithm, normaliser: VecNormalize) -> None:
    """Give an agent the weights, and a normaliser the statistics, of the newest checkpoint in a folder.

    Raises:
        InputError: the folder holds no checkpoint, or one of another algorithm or network.
    """
    checkpoint = newest_checkpoint(folder)
    if checkpoint is None:
        raise InputError(
            f"{folder}: no checkpoint yet; train it with `python -m training.train --out {folder}`"
        )
    try:
        agent.set_parameters(str(checkpoint / "agent.zip"), exact_match=True, device="cpu")
        with (checkpoint / "normaliser.pkl").open("rb") as stored:
            other = pickle.load(stored)
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(
            f"{folder}: not a run with this algorithm, network, stack and task ({error})"
        ) from error
    normaliser.obs_rms, normaliser.ret_rms = other.obs_rms, other.ret_rms
    if isinstance(agent.policy, StateDependentStdPolicy):
        # A trained policy hardly explores any more and would learn nothing new.
        agent.policy.reset_std(agent.policy.log_std_init)


def about(settings: TrainingSettings, steps_done: int, commands: Sequence[str]) -> dict[str, Any]:
    """Return the description in a policy file: of a policy trained by these commands, with `steps_done`."""
    model = model_of(settings)
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
