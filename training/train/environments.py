"""The environments of a training run: robots, opponents and senses as its settings say.

`training_env` gives what Stable-Baselines3 learns in: the native vector environments with the policy's
memory (`vec_env`), its monitor and its normaliser.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv, VecMonitor, VecNormalize

from mecanum_env.batch import planar_robot
from mecanum_env.effects.definition import RobotPlant
from mecanum_env.errors import EffectRefusedError
from mecanum_env.model import Model, paper_model, read_model
from mecanum_env.senses import Senses, VariedSenses
from mecanum_env.tankendo import Opponent, Opponents, opponent_for
from mecanum_env.tankendo.build import Engine
from mecanum_env.tankendo.opponents import PARAMETERS
from mecanum_env.tankendo.randomize import Randomize
from mecanum_env.tankendo.vector import TankendoVectorEnv
from training.train.robots import level_models, varied_models
from training.train.settings import TrainingSettings
from training.train.vec_env import StackedVecEnv, TankendoVecEnv
from training.train.workers import WorkersVecEnv

_CLIP: Final = 10.0
"""Largest absolute value of a normalised observation."""
_FIRST_SEED: Final = 2**40
"""Training seeds are at least this, so that no evaluated episode has been trained on."""
_ROBOTS: Final = 128
"""Robots drawn between two checkpoints with `--randomize varied`."""
_LEAD_FORMS: Final = ("adaptive", "adaptive", "constant_velocity", "none")
"""Forms of the lead of varied opponents; the usual one twice as often."""


def model_of(settings: TrainingSettings) -> Model:
    """Return the model that is trained on or varied.

    Raises:
        InputError: there is no such file, or it holds no model.
    """
    return paper_model() if settings.model is None else read_model(settings.model)


def opponents_of(settings: TrainingSettings, steps_done: int) -> Opponent | Opponents:
    """Return the opponents of the part of a training that begins after `steps_done`."""
    usual = opponent_for(settings.difficulty)
    if settings.opponents == "level":
        return usual
    ends = {one.name: one.ends for one in PARAMETERS if one.name != "warning_s"}
    return Opponents(
        replace(usual, warning_s=warning_range(settings, steps_done)), {**ends, "lead_form": _LEAD_FORMS}
    )


def warning_range(settings: TrainingSettings, steps_done: int) -> tuple[float, float]:
    """Return the range of the warning time of varied opponents after `steps_done` [s].

    It widens linearly from `first_warning_s` to `warning_s`.
    """
    whole = settings.curriculum * settings.steps
    share = 1.0 if whole == 0.0 else min(steps_done / whole, 1.0)
    low, high = (
        first + share * (last - first)
        for first, last in zip(settings.first_warning_s, settings.warning_s, strict=True)
    )
    return low, high


def native_envs(
    settings: TrainingSettings, steps_done: int = 0, rows: range | None = None
) -> list[TankendoVectorEnv]:
    """Return the native environments of the part of a training that begins after `steps_done`.

    They have all rows of the training, or some consecutive `rows` of them.
    """
    arguments: dict[str, Any] = {
        "task": settings.task,
        "plant": settings.plant,
        "difficulty": settings.difficulty,
        "opponent": opponents_of(settings, steps_done),
        "action_mode": settings.action_mode,
        "reward_weights": dict(settings.reward_weights),
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }
    model = model_of(settings)
    arguments["engine"] = engine_for(model, settings.plant)
    models: list[Model] = [model]
    randomize: Randomize = "none"
    if settings.randomize == "levels":
        models = list(level_models(model).values())
    elif settings.randomize == "posterior":
        randomize = "posterior"
    elif settings.randomize == "varied":
        rng = np.random.default_rng((settings.seed, steps_done, 2))
        randomize = varied_models(model, settings.latency_s, _ROBOTS, rng)
    kinds = [(one, senses) for one in models for senses in senses_of(settings)]
    # As evenly as possible; the first ones get one more.
    of_kinds = np.array_split(np.arange(settings.envs), len(kinds))
    sizes = [sum(rows is None or row in rows for row in part.tolist()) for part in of_kinds]
    return [
        TankendoVectorEnv(size, model=one, senses=senses, randomize=randomize, **arguments)
        for (one, senses), size in zip(kinds, sizes, strict=True)
        if size
    ]


@dataclass(frozen=True)
class Rows:
    """Some consecutive environments of a training, those with the numbers `numbers`."""

    settings: TrainingSettings
    numbers: range

    @property
    def rows(self) -> int:
        """How many they are."""
        return len(self.numbers)

    def make(self) -> VecEnv:
        """Return them with the policy's memory."""
        natives = native_envs(self.settings, 0, self.numbers)
        env = TankendoVecEnv(*natives, margin_weight=self.settings.margin_weight)
        return StackedVecEnv(
            env,
            self.settings.stack,
            has_time_to_cut=self.settings.time_to_cut,
            privileged=self.settings.privileged != "none",
        )

    def renew(self, env: VecEnv, steps_done: int) -> None:
        """Give `env` opponents and robots of the part of the training after `steps_done`; then reset it."""
        env.unwrapped.close()
        env.unwrapped.envs = tuple(native_envs(self.settings, steps_done, self.numbers))


def engine_for(model: Model, plant: RobotPlant) -> Engine:
    """Return what simulates a model: arrays, which are fast, unless MuJoCo alone knows plant or effects."""
    if plant == "rollers":
        return "mujoco"
    try:
        planar_robot(model)
    except EffectRefusedError:
        return "mujoco"
    return "arrays"


def senses_of(settings: TrainingSettings) -> list[Senses | VariedSenses | None]:
    """Return the senses of a training; its environments are shared out among them."""
    known: dict[str, list[Senses | VariedSenses | None]] = {
        "off": [None],
        "usual": [Senses()],
        "varied": [VariedSenses()],
        "mixed": [None, VariedSenses()],
    }
    return known[settings.senses]


def bare_env(settings: TrainingSettings) -> VecEnv:
    """Return the environments with the policy's memory, but without monitor and normaliser."""
    if settings.workers < 2:
        return Rows(settings, range(settings.envs)).make()
    parts = np.array_split(np.arange(settings.envs), min(settings.workers, settings.envs))
    return WorkersVecEnv([Rows(settings, range(part[0], part[-1] + 1)) for part in parts])


def renew(env: VecEnv, settings: TrainingSettings, steps_done: int) -> None:
    """Give the environments of a training robots and opponents of its part after `steps_done`.

    Their next episodes have them: a reset must follow.
    """
    base = env.unwrapped
    if isinstance(base, WorkersVecEnv):
        base.renew(steps_done)
    else:
        Rows(settings, range(settings.envs)).renew(base, steps_done)


def training_env(settings: TrainingSettings) -> VecNormalize:
    """Return the environments with monitor and normaliser."""
    return VecNormalize(VecMonitor(bare_env(settings)), gamma=settings.gamma, clip_obs=_CLIP)


def episode_seeds(settings: TrainingSettings, steps_done: int) -> list[int]:
    """Return the seed of each environment for the part of the training that begins after `steps_done`."""
    drawn = np.random.SeedSequence((settings.seed, steps_done)).generate_state(settings.envs)
    return [_FIRST_SEED + int(number) for number in drawn]
