"""A training folder: what is in it, and checkpoints that are there whole or not at all.

run.json                settings, seed, versions, commit, the command
curve.json              success on the development seeds after so many steps
policy.npz              the policy as it is now, for `training.controllers.load_policy`
tensorboard/            for `tensorboard --logdir FOLDER`
checkpoints/000250000/  agent.zip (Stable-Baselines3), normaliser.pkl (VecNormalize), policy.npz,
                        state.json, and replay.pkl of SAC, in the newest only
"""

from __future__ import annotations

import json
import os
import pickle
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from mecanum_env.errors import InputError
from mecanum_env.files import write_json
from training.controllers.policy import save_policy
from training.train.agent import SeenSpreadPolicy, read_agent
from training.train.environments import model_of
from training.train.export import about, network_of
from training.train.settings import Settings, settings_from_json, settings_json


@dataclass(frozen=True)
class Point:
    """One point of the learning curve."""

    steps: int
    success: float
    """Share of successes with the deterministic policy, on the development seeds; of levels the mean."""
    worst: float
    """Of levels the least; without levels the same as `success`."""
    wall_s: float
    """Spent on training until now, by the clock [s]."""
    processor_s: float
    """The same by the processor [s]: what it would take on a machine without other work."""


@dataclass(frozen=True)
class State:
    """Where a run is."""

    steps_done: int = 0
    curve: tuple[Point, ...] = field(default=())
    wall_s: float = 0.0
    processor_s: float = 0.0


def write_checkpoint(
    folder: Path,
    agent: BaseAlgorithm,
    normaliser: VecNormalize,
    settings: Settings,
    state: State,
    commands: Sequence[str],
) -> None:
    """Write a checkpoint, then `policy.npz` and `curve.json` beside it.

    Args:
        folder: of the run.
        agent: the learner.
        normaliser: of its observations and rewards.
        settings: of the run.
        state: where it is.
        commands: that train it; the last one is this run's, those before the runs' that it began with.
    """
    target = folder / "checkpoints" / f"{state.steps_done:09d}"
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(dir=target.parent, prefix=".writing-"))
    try:
        agent.save(temporary / "agent.zip")
        normaliser.save(str(temporary / "normaliser.pkl"))
        if settings.algo == "sac":
            agent.save_replay_buffer(temporary / "replay.pkl")
        network = network_of(agent, normaliser, settings)
        facts = about(settings, model_of(settings), state.steps_done, commands)
        save_policy(temporary / "policy.npz", network, facts)
        write_json(temporary / "state.json", asdict(state))
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
    write_json(folder / "curve.json", [asdict(point) for point in state.curve])


def write_run(folder: Path, settings: Settings, facts: dict[str, Any]) -> None:
    """Write `run.json`.

    Args:
        folder: of the run.
        settings: of the run.
        facts: versions, commit and command.
    """
    write_json(folder / "run.json", {"settings": settings_json(settings), **facts})


def read_run(folder: Path) -> tuple[Settings, dict[str, Any]]:
    """Return a run's settings, and what else `run.json` of its folder says.

    Raises:
        InputError: it is no training folder.
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
            f"{path}: not what `python -m training.train` writes, or changed since; give another folder"
        ) from error
    return settings, stored


def commands_before(settings: Settings) -> list[str]:
    """Return the commands of the runs whose weights a run with these settings begins with, oldest first.

    Raises:
        InputError: a folder holds no run.
    """
    if settings.start is None:
        return []
    return list(read_run(Path(settings.start))[1]["commands"])


def newest_checkpoint(folder: Path) -> Path:
    """Return the newest checkpoint of a run's folder.

    Raises:
        InputError: it has none.
    """
    found = sorted((folder / "checkpoints").glob("[0-9]*"))
    if not found:
        raise InputError(
            f"{folder}: no checkpoint yet; train it with `python -m training.train --out {folder}`"
        )
    return found[-1]


def read_state(checkpoint: Path) -> State:
    """Return where the run was at a checkpoint.

    Raises:
        InputError: the checkpoint is not readable.
    """
    path = checkpoint / "state.json"
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        stored["curve"] = tuple(Point(**point) for point in stored["curve"])
        return State(**stored)
    except (OSError, KeyError, TypeError, json.JSONDecodeError) as error:
        raise InputError(f"{path}: no state of a checkpoint ({error!r})") from error


def read_learner(checkpoint: Path, settings: Settings, env: VecEnv) -> tuple[BaseAlgorithm, VecNormalize]:
    """Return learner and normaliser of a checkpoint.

    Args:
        checkpoint: its folder. Stable-Baselines3's files are pickled: open only your own.
        settings: of the run.
        env: what is normalised.
    """
    try:
        normaliser = VecNormalize.load(str(checkpoint / "normaliser.pkl"), env)
        agent = read_agent(settings, normaliser, checkpoint / "agent.zip")
        if settings.algo == "sac":
            agent.load_replay_buffer(checkpoint / "replay.pkl")
    except (OSError, ValueError) as error:
        raise InputError(f"{checkpoint}: checkpoint not readable ({error})") from error
    return agent, normaliser


def begin_with(folder: Path, agent: BaseAlgorithm, normaliser: VecNormalize) -> None:
    """Give a learner the weights, and a normaliser the statistics, that another run ended with.

    Args:
        folder: of the other run.
        agent: changed in place; its network must be built like the other's.
        normaliser: changed in place.

    Raises:
        InputError: the folder holds no checkpoint, or one of another algorithm or network.
    """
    checkpoint = newest_checkpoint(folder)
    try:
        agent.set_parameters(str(checkpoint / "agent.zip"), exact_match=True, device="cpu")
        with (checkpoint / "normaliser.pkl").open("rb") as stored:
            other = pickle.load(stored)
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(
            f"{folder}: not a run with this algorithm, network, stack and task ({error})"
        ) from error
    normaliser.obs_rms, normaliser.ret_rms = other.obs_rms, other.ret_rms
    if isinstance(agent.policy, SeenSpreadPolicy):
        # A trained policy hardly varies its actions any more, and would learn nothing new.
        agent.policy.spread_anew(agent.policy.log_std_init)
