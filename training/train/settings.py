"""The settings of a training run: everything that decides its result, saved with it."""

from __future__ import annotations

import math
import shlex
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Any, Final, Literal, cast, get_args

from mecanum_env.effects.definition import RobotPlant
from mecanum_env.errors import InputError, did_you_mean, require_at_least
from mecanum_env.registration import ENVIRONMENTS
from mecanum_env.tankendo.actions import ActionMode, check_mode

if TYPE_CHECKING:
    from mecanum_env.tankendo.arena import TaskName

Algorithm = Literal["ppo", "sac"]
TrainingRobots = Literal["none", "posterior", "levels", "varied"]
"""Robots to train on: the model; one drawn for each episode from the model's uncertainty; the robots of
`training.train.robots.level_models` side by side; one of many that `varied_models` draws, late and slow."""
TrainingOpponents = Literal["level", "varied"]
"""Opponents to train against: that of the difficulty; drawn for each episode from the ranges of people."""
TrainingSenses = Literal["off", "usual", "varied", "mixed"]
"""What the robot senses in training: plain sensors; `Senses()`; `VariedSenses()`, drawn anew each time; half
of the environments the first, half the last."""
PrivilegedTo = Literal["none", "critic", "both"]
"""Who sees the numbers of `training.train.privileged`: nobody, the critic alone, or also the actor, which is
then no policy for a robot but the teacher of one."""

Device = Literal["cpu", "cuda"]

_LARGEST_SEED: Final = 2**32 - 1
"""Largest seed of NumPy's legacy generator, which Stable-Baselines3 seeds."""
_MOST: Final = sys.float_info.max
_Range = tuple[float, float, str]
_ANY: Final = (-_MOST, _MOST, "a finite number")
_NOT_NEGATIVE: Final = (0.0, _MOST, "a finite number of at least 0")
_SHARE: Final = (0.0, 1.0, "a number from 0 to 1")
_POSITIVE: Final = (1.0, _MOST, "at least 1")
_RANGES: Final[Mapping[str, _Range]] = {
    **dict.fromkeys(
        ("learning_rate", "last_learning_rate", "clip_range", "prediction_weight"), _NOT_NEGATIVE
    ),
    **dict.fromkeys(("renewed_at", "learning_starts"), _NOT_NEGATIVE),
    **dict.fromkeys(("gamma", "gae_lambda"), _SHARE),
    **dict.fromkeys(("layers", "rollout_steps", "epochs", "updates_a_step", "buffer_size"), _POSITIVE),
    **dict.fromkeys(("entropy_weight", "log_std", "renewed_log_std"), _ANY),
}
"""Hyperparameter -> smallest value, largest value, and both in words; for layers, of each one."""


@dataclass(frozen=True)
class Ppo:
    """Hyperparameters of proximal policy optimisation; the defaults are tuned for the dodge."""

    learning_rate: float = 5e-4
    """At the start; it falls linearly."""
    last_learning_rate: float = 5e-5
    """At the end."""
    rollout_steps: int = 32
    """Steps of each environment between two updates."""
    batch_size: int = 1024
    """Steps in a minibatch."""
    epochs: int = 10
    """Passes over a rollout."""
    gamma: float = 0.99
    """Discount per step of 0.1 s."""
    gae_lambda: float = 0.95
    """Lambda of generalised advantage estimation."""
    clip_range: float = 0.2
    """Clipping range of the probability ratio."""
    entropy_weight: float = 0.0
    """Weight of the entropy bonus."""
    prediction_weight: float = 0.0
    """Weight of a further task of the actor, whose critic sees more: to predict that from what it sees."""
    log_std: float = -0.7
    """Logarithm of the actions' standard deviation at the start; it then depends on the observation."""
    renewed_at: float = 0.4
    """Share of the steps after which, at the next checkpoint, the standard deviation is reset in all states;
    1: never. A policy that has given up on one technique would otherwise no longer explore against it."""
    renewed_log_std: float = -1.5
    """Logarithm of the standard deviation after the reset."""
    layers: tuple[int, ...] = (64, 64)
    """Units of each hidden layer of the actor, and of the critic."""
    activation: Literal["tanh", "relu"] = "tanh"
    """Activation function between the layers."""


@dataclass(frozen=True)
class Sac:
    """Hyperparameters of soft actor-critic; not tuned."""

    learning_rate: float = 1e-3
    """At the start; it falls linearly."""
    last_learning_rate: float = 1e-4
    """At the end."""
    batch_size: int = 256
    """Steps in a minibatch."""
    updates_a_step: int = 4
    """Gradient steps per step of all environments."""
    buffer_size: int = 300_000
    """Size of the replay buffer, in steps of single environments."""
    learning_starts: int = 10_000
    """Steps with random actions at the start."""
    gamma: float = 0.98
    """Discount per step of 0.1 s."""
    layers: tuple[int, ...] = (128, 128)
    """Units of each hidden layer of the actor, and of the critics."""
    activation: Literal["tanh", "relu"] = "relu"
    """Activation function between the layers."""


@dataclass(frozen=True)
class TrainingSettings:
    """A training run. Runs with the same settings and versions end with the same weights, bit for bit."""

    algo: Algorithm = "ppo"
    env: str = "MecanumTankendo-v0"
    steps: int = 2_000_000
    """Steps of all environments together; the learning rate falls over this number."""
    seed: int = 0
    plant: RobotPlant = "planar"
    model: str | None = None
    """Path of a model file; None: the packaged model."""
    difficulty: str = "normal"
    randomize: TrainingRobots = "none"
    opponents: TrainingOpponents = "level"
    latency_s: tuple[float, float] = (0.0, 0.15)
    """Range of the extra latency of varied robots [s]."""
    warning_s: tuple[float, float] = (0.3, 1.0)
    """Range of the warning time of varied opponents at the end of the curriculum [s]."""
    first_warning_s: tuple[float, float] = (0.44, 0.58)
    """The same at its beginning."""
    curriculum: float = 0.0
    """Share of the steps over which the range widens, at each checkpoint; 0: it is the last at once. A policy
    that begins with short warnings learns to move as soon as the sword does, and stays with it."""
    senses: TrainingSenses = "off"
    privileged: PrivilegedTo = "none"
    teacher: str | None = None
    """A policy to imitate at first: a file, the folder of a run, or the name of a bundled one; None: none."""
    teacher_steps: int = 250_000
    """Steps for which the teacher is imitated; PPO goes on from there."""
    start: str | None = None
    """Folder of a run to take the initial weights and normaliser from; None: new ones."""
    envs: int = 128
    """Number of environments side by side."""
    workers: int = 1
    """Number of processes that simulate them; the weights do not depend on it (`training.train.workers`)."""
    threads: int = 1
    """Number of threads of the networks on the processor. Rounding, and so the weights, depend on it; small
    networks and minibatches gain nothing by more than one."""
    device: Device = "cpu"
    """Where the networks learn: this machine's processor, or its GPU by CUDA."""
    action_mode: ActionMode = "cartesian"
    stack: int = 2
    """Number of observations, 0.1 s apart, that the policy sees."""
    time_to_cut: bool = False
    """Whether it also sees how long the sword will still rise, by place and velocity of its tip
    (`training.controllers.features`)."""
    checkpoint_every: int = 250_000
    """Steps between two checkpoints, at each of which all environments begin anew."""
    reward_weights: Mapping[str, float] = field(default_factory=lambda: {"waiting": 0.05, "out": 5.0})
    """Weights of the reward that differ from the environment's. By default waiting costs more, so that a
    beginner soon offers an opening, and leaving the field so much that it is no way out of waiting."""
    margin_weight: float = 0.0
    """Weight of a further term: at the hit, the margin by which it misses or, if negative, hits, -1 to 1.
    A beginner that is always hit learns from it in which direction the miss lies."""
    ppo: Ppo = field(default_factory=Ppo)
    sac: Sac = field(default_factory=Sac)

    def __post_init__(self) -> None:
        choices = {
            "algo": get_args(Algorithm),
            "env": tuple(ENVIRONMENTS),
            "randomize": get_args(TrainingRobots),
            "opponents": get_args(TrainingOpponents),
            "senses": get_args(TrainingSenses),
            "privileged": get_args(PrivilegedTo),
            "device": get_args(Device),
        }
        for name, known in choices.items():
            value = getattr(self, name)
            if value not in known:
                raise InputError(
                    f"{name} = {value!r}{did_you_mean(value, known)}, must be {', '.join(known)}"
                )
        check_mode(self.action_mode)
        require_at_least(
            1,
            steps=self.steps,
            envs=self.envs,
            workers=self.workers,
            threads=self.threads,
            stack=self.stack,
            checkpoint_every=self.checkpoint_every,
        )
        for name in ("latency_s", "warning_s", "first_warning_s"):
            _require_range(name, getattr(self, name))
        if not 0.0 <= self.curriculum <= 1.0:
            raise InputError(f"curriculum = {self.curriculum}, must be a number from 0 to 1")
        if self.privileged != "none" and self.algo != "ppo":
            raise InputError(f"privileged = {self.privileged!r}: only PPO has it")
        if self.ppo.prediction_weight > 0.0 and self.privileged != "critic":
            raise InputError(
                f"ppo.prediction_weight = {self.ppo.prediction_weight}: the actor predicts what only its "
                "critic sees; give privileged = critic"
            )
        if self.teacher is not None and self.algo != "ppo":
            raise InputError(f"teacher = {self.teacher!r}: only PPO has one")
        require_at_least(0, teacher_steps=self.teacher_steps)
        if not 0 <= self.seed <= _LARGEST_SEED:
            raise InputError(f"seed = {self.seed}, must be from 0 to {_LARGEST_SEED}")
        for name, weight in self.reward_weights.items():
            if not math.isfinite(weight):
                raise InputError(f"reward_weights: {name} = {weight}, must be a finite number")
        # PPO normalises advantages over a minibatch.
        _require_within("ppo", self.ppo, {**_RANGES, "batch_size": (2.0, _MOST, "at least 2")})
        _require_within("sac", self.sac, {**_RANGES, "batch_size": _POSITIVE})
        if self.ppo.rollout_steps * self.envs < 2:
            raise InputError("ppo.rollout_steps = 1 with envs = 1: a rollout must have at least 2 steps")

    @property
    def task(self) -> TaskName:
        """The environment's task: dodge, track or duel."""
        return cast("TaskName", ENVIRONMENTS[self.env])

    @property
    def gamma(self) -> float:
        """The discount of the algorithm."""
        return self.ppo.gamma if self.algo == "ppo" else self.sac.gamma


def _require_range(name: str, ends: tuple[float, float]) -> None:
    if len(ends) != 2 or not 0.0 <= ends[0] <= ends[1] < math.inf:
        raise InputError(f"{name} = {ends}, must be two numbers of at least 0, the lower first")


def _require_within(section: str, given: Ppo | Sac, ranges: Mapping[str, _Range]) -> None:
    for name, value in asdict(given).items():
        if name in ranges:
            least, most, right = ranges[name]
            for one in value if isinstance(value, tuple) else (value,):
                if not least <= one <= most:
                    raise InputError(f"{section}.{name} = {one}, must be {right}")


def settings_from_json(stored: Mapping[str, Any]) -> TrainingSettings:
    """Return settings from a JSON object, `asdict(settings)` as `stored` in a folder.

    Raises:
        InputError: a name is unknown or a value is missing or wrong.
    """
    values = dict(stored)
    known = {one.name for one in fields(TrainingSettings)}
    unknown = sorted(set(values) - known)
    if unknown:
        raise InputError(f"settings: no {unknown[0]!r}{did_you_mean(unknown[0], known)}")
    try:
        for name, kind in (("ppo", Ppo), ("sac", Sac)):
            own = dict(values[name])
            own["layers"] = tuple(own["layers"])
            values[name] = kind(**own)
        for name in ("latency_s", "warning_s", "first_warning_s"):
            if name in values:
                values[name] = tuple(values[name])
        return TrainingSettings(**values)
    except (KeyError, TypeError) as error:
        raise InputError(f"settings: not those of a training run, {error} is missing or wrong") from error


def command_line(settings: TrainingSettings, folder: str) -> str:
    """Return the command that trains with these settings into a new folder."""
    words = ["python", "-m", "training.train", "--out", folder]
    usual = asdict(TrainingSettings())
    for name, value in asdict(settings).items():
        if name in ("ppo", "sac"):
            for key, own in value.items():
                if own != usual[name][key]:
                    words += [f"--{name}.{key}".replace("_", "-"), *_words(own)]
        elif value != usual[name]:
            # A flag has no value.
            words += [f"--{name}".replace("_", "-"), *([] if value is True else _words(value))]
    return shlex.join(words)


def _words(value: Any) -> list[str]:
    if isinstance(value, Mapping):
        return [str(part) for pair in value.items() for part in pair]
    return [str(part) for part in value] if isinstance(value, list | tuple) else [str(value)]
