"""A training folder, with checkpoints that are there whole or not at all.

run.json                settings, versions, commit and commands
curve.json              success on the development seeds at each checkpoint
policy.npz              the policy of the best checkpoint, for `training.controllers.policy.load_policy`
tensorboard/            for `tensorboard --logdir FOLDER`
checkpoints/000250000/  the learner (`training.train.learner_files`), policy.npz, state.json; SAC's replay
                        buffer in the newest only
"""

from __future__ import annotations

import os
import platform
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final

from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecNormalize

from mecanum_env.errors import InputError, write_error
from mecanum_env.files import STAGED, sync, write_json
from mecanum_env.model import model_to_dict
from mecanum_env.outputs import finish_interrupted, output_folder
from mecanum_env.reading import read_bytes, read_json
from training.controllers.policy import load_network, save_policy
from training.train.actor_critic import StateDependentStdPolicy
from training.train.agent import make_agent, network_of
from training.train.environments import model_of, training_env
from training.train.learner_files import REPLAY, read_replay, read_weights, write_learner
from training.train.settings import TrainingSettings, settings_from_json

_POLICY, _CURVE = "policy.npz", "curve.json"
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
    """Training time until now by the processor [s], of all threads of this process, but without those of
    `workers`: with one of each the time that it takes on an idle machine."""


@dataclass(frozen=True)
class State:
    """How far a run has come."""

    steps_done: int = 0
    curve: tuple[Point, ...] = ()
    wall_s: float = 0.0
    processor_s: float = 0.0
    updates: int = 0
    """Gradient updates until now, for the learner's own count."""

    @property
    def table(self) -> str:
        """The learning curve as lines for a terminal."""
        lines = ["   steps  success  minutes  of the processor"]
        for point in self.curve:
            minutes = f"{point.wall_s / 60:7.1f}  {point.processor_s / 60:7.1f}"
            lines.append(f"{point.steps:8d}  {point.success:7.3f}  {minutes}")
        return "\n".join(lines)


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
    target = folder / "checkpoints" / _name(run.state.steps_done)
    target.parent.mkdir(parents=True, exist_ok=True)
    for left in target.parent.glob(f"{STAGED}*"):
        shutil.rmtree(left, ignore_errors=True)
    temporary = Path(tempfile.mkdtemp(dir=target.parent, prefix=STAGED))
    try:
        write_learner(temporary, agent, run.normaliser)
        network = network_of(agent, run.normaliser, settings)
        save_policy(temporary / _POLICY, network, about(settings, run.state.steps_done, run.commands))
        write_json(temporary / "state.json", asdict(run.state))
        temporary.chmod(0o755)
        for path in (*temporary.iterdir(), temporary):
            sync(path)
        if target.exists():
            shutil.rmtree(target)
        os.replace(temporary, target)
        sync(target.parent)
    except OSError as error:
        raise write_error(target, error) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    for older in target.parent.glob(f"*/{REPLAY}"):
        if older.parent != target:
            older.unlink()
    export_best(folder)


def export_best(folder: Path) -> None:
    """Make `policy.npz` of a run that of its best checkpoint, and `curve.json` whole, if they are not yet.

    A run that ended between its last checkpoint and this has older ones.

    Raises:
        InputError: the checkpoint cannot be read, or the folder not be written.
    """
    newest = newest_checkpoint(folder)
    if newest is None:
        return
    load_network(newest / _POLICY)  # refuses a torn one
    points = read_state(newest).curve
    best = best_point(points, [path.name for path in newest.parent.iterdir()])
    network, told = load_network(newest.parent / _name(best.steps) / _POLICY)
    chosen = {"of": len(points), "success": best.success, "newest_steps": points[-1].steps}
    curve = [asdict(point) for point in points]
    with tempfile.TemporaryDirectory() as apart:
        save_policy(Path(apart) / _POLICY, network, {**told, "chosen": chosen})
        policy = read_bytes(Path(apart) / _POLICY)
    finish_interrupted(folder)
    if (folder / _CURVE).is_file() and (folder / _POLICY).is_file():
        whole = (folder / _POLICY).read_bytes() == policy
        if whole and read_json(folder / _CURVE) == curve:
            return
    with output_folder(folder, "training.train", (_POLICY, _CURVE), locked=True) as staged:
        (staged / _POLICY).write_bytes(policy)
        write_json(staged / _CURVE, curve)


def best_point(points: Sequence[Point], checkpoints: Sequence[str]) -> Point:
    """Return the point of a curve with the most successes, the newest of equal ones.

    Only those count whose checkpoint is still among the folders named `checkpoints`; the newest is.
    """
    kept = [point for point in points if _name(point.steps) in checkpoints]
    return max(kept, key=lambda point: (point.success, point.steps))


def _name(steps: int) -> str:
    """Return the name of a checkpoint's folder."""
    return f"{steps:09d}"


def write_run(folder: Path, settings: TrainingSettings, facts: dict[str, Any]) -> None:
    """Write `run.json` with the settings of a run and other facts: versions, commit and commands."""
    write_json(folder / "run.json", {"settings": asdict(settings), **facts})


def read_run(folder: Path) -> tuple[TrainingSettings, dict[str, Any]]:
    """Return a run's settings and the remaining entries of `run.json` in its folder.

    Raises:
        InputError: the folder is no training folder.
    """
    path = folder / "run.json"
    stored = read_json(path, "give the folder of `python -m training.train`")
    try:
        settings = settings_from_json(stored.pop("settings"))
        list(stored["commands"])
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
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
    stored = read_json(path, "give the folder of `python -m training.train`")
    try:
        stored["curve"] = tuple(Point(**point) for point in stored["curve"])
        state = State(**stored)
        if type(state.steps_done) is not int or type(state.updates) is not int:
            raise TypeError("steps are whole numbers")
    except (AttributeError, KeyError, TypeError) as error:
        raise InputError(
            f"{path}: not the state of a checkpoint; remove {checkpoint} to go on from the one before"
        ) from error
    return state


def read_learner(checkpoint: Path, settings: TrainingSettings) -> tuple[BaseAlgorithm, VecNormalize]:
    """Return learner and normaliser of a checkpoint, with new environments to learn in.

    Raises:
        InputError: the checkpoint cannot be read.
    """
    state = read_state(checkpoint)
    normaliser = training_env(settings)
    agent = make_agent(settings, normaliser)
    try:
        read_weights(checkpoint, agent, normaliser)
        if settings.algo == "sac":
            read_replay(checkpoint, agent)
    except InputError:
        normaliser.close()
        raise
    agent.num_timesteps, agent._n_updates = state.steps_done, state.updates
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
    read_weights(checkpoint, agent, normaliser)
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
