"""What a training run is told: everything that decides its result, as one record that is saved with it."""

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
ALGORITHMS: Final[tuple[Algorithm, ...]] = get_args(Algorithm)
TrainingRobots = Literal["none", "posterior", "levels"]
ROBOTS: Final[tuple[TrainingRobots, ...]] = get_args(TrainingRobots)
"""On which robots: the model; for each episode one drawn from what its identification left open; the plants
of `training.train.environments` side by side."""

_COUNTS: Final = ("steps", "envs", "stack", "checkpoint_every")
_LARGEST_SEED: Final = 2**32 - 1  # numpy's own generator, which Stable-Baselines3 seeds, takes no more
_Range = tuple[float, float, str]
_MOST: Final = sys.float_info.max
_ANY: Final = (-_MOST, _MOST, "a finite number")
_NOT_NEGATIVE: Final = (0.0, _MOST, "a finite number of at least 0")
_SHARE: Final = (0.0, 1.0, "a number from 0 to 1")
_SOME: Final = (1.0, _MOST, "at least 1")
_BOTH: Final[Mapping[str, _Range]] = {
    "learning_rate": _NOT_NEGATIVE,
    "last_learning_rate": _NOT_NEGATIVE,
    "gamma": _SHARE,
    "layers": _SOME,
}
_PPO: Final[Mapping[str, _Range]] = {
    **_BOTH,
    "rollout_steps": _SOME,
    "batch_size": (2.0, _MOST, "at least 2"),  # advantages are normalised over a minibatch
    "epochs": _SOME,
    "gae_lambda": _SHARE,
    "clip_range": _NOT_NEGATIVE,
    "entropy_weight": _ANY,
    "log_std": _ANY,
    "renewed_at": _NOT_NEGATIVE,
    "renewed_log_std": _ANY,
}
_SAC: Final[Mapping[str, _Range]] = {
    **_BOTH,
    "batch_size": _SOME,
    "updates_a_step": _SOME,
    "buffer_size": _SOME,
    "learning_starts": _NOT_NEGATIVE,
}
"""Name of a number -> the least and the most that it may be, and that in words; of layers, each one."""


@dataclass(frozen=True)
class Ppo:
    """Numbers of proximal policy optimisation; the defaults were tuned for the dodge (docs/training.md)."""

    learning_rate: float = 5e-4
    """At the start; falls evenly."""
    last_learning_rate: float = 5e-5
    """At the end."""
    rollout_steps: int = 32
    """Steps of each environment between two updates."""
    batch_size: int = 1024
    """Steps in a minibatch."""
    epochs: int = 10
    """Passes over a rollout."""
    gamma: float = 0.99
    """Discount of a step of 0.1 s."""
    gae_lambda: float = 0.95
    """Of generalised advantage estimation."""
    clip_range: float = 0.2
    """Largest change of an action's probability that is rewarded in one update, as a share."""
    entropy_weight: float = 0.0
    """Reward for varied actions."""
    log_std: float = -0.7
    """Logarithm of the actions' standard deviation at the start; it then depends on what is seen."""
    renewed_at: float = 0.4
    """Share of the steps after which, at the next checkpoint, all states get the same spread again; 1: never.
    A policy that has given up one technique no longer varies what it does against it."""
    renewed_log_std: float = -1.5
    """Logarithm of that standard deviation."""
    layers: tuple[int, ...] = (64, 64)
    """Units of each hidden layer; the critic has the same."""
    activation: Literal["tanh", "relu"] = "tanh"
    """Between the layers."""


@dataclass(frozen=True)
class Sac:
    """Numbers of soft actor-critic."""

    learning_rate: float = 1e-3
    """At the start; falls evenly."""
    last_learning_rate: float = 1e-4
    """At the end."""
    batch_size: int = 256
    updates_a_step: int = 4
    """Gradient steps each time that all environments have stepped once."""
    buffer_size: int = 300_000
    """Steps that are remembered, those of all environments together."""
    learning_starts: int = 10_000
    """Steps with random actions at the start."""
    gamma: float = 0.98
    """Discount of a step of 0.1 s."""
    layers: tuple[int, ...] = (128, 128)
    """Units of each hidden layer; the critics have the same."""
    activation: Literal["tanh", "relu"] = "relu"
    """Between the layers."""


@dataclass(frozen=True)
class Settings:
    """A training run. Two runs with the same settings and versions end with the same weights, bit for bit."""

    algo: Algorithm = "ppo"
    env: str = "MecanumTankendo-v0"
    steps: int = 2_000_000
    """Of all environments together; the learning rate falls over this number."""
    seed: int = 0
    plant: RobotPlant = "planar"
    model: str | None = None
    """Path of a model file; None: the packaged model."""
    difficulty: str = "normal"
    randomize: TrainingRobots = "none"
    start: str | None = None
    """Folder of another run whose weights and normaliser this one begins with; None: new ones."""
    envs: int = 128
    """Environments side by side."""
    action_mode: ActionMode = "cartesian"
    stack: int = 2
    """How many observations, of 0.1 s each, the policy looks at."""
    checkpoint_every: int = 250_000
    """Steps between two checkpoints; at each one all environments begin anew."""
    reward_weights: Mapping[str, float] = field(default_factory=lambda: {"waiting": 0.05, "out": 5.0})
    """Of the environment's reward, those that differ from its own. By default waiting costs more, so that a
    beginner soon offers an opening, and leaving the field so much that it is no way out of waiting."""
    ppo: Ppo = field(default_factory=Ppo)
    sac: Sac = field(default_factory=Sac)

    def __post_init__(self) -> None:
        _one_of("algo", self.algo, ALGORITHMS)
        _one_of("env", self.env, ENVIRONMENTS)
        _one_of("randomize", self.randomize, ROBOTS)
        check_mode(self.action_mode)
        require_at_least(1, **{name: getattr(self, name) for name in _COUNTS})
        if not 0 <= self.seed <= _LARGEST_SEED:
            raise InputError(f"seed = {self.seed}, must be from 0 to {_LARGEST_SEED}")
        for name, weight in self.reward_weights.items():
            if not math.isfinite(weight):
                raise InputError(f"reward_weights: {name} = {weight}, must be a finite number")
        _require_within("ppo", self.ppo, _PPO)
        _require_within("sac", self.sac, _SAC)
        if self.ppo.rollout_steps * self.envs < 2:
            raise InputError("ppo.rollout_steps = 1 of envs = 1, must be at least 2 steps together")

    @property
    def task(self) -> TaskName:
        """The environment's task: dodge, track or duel."""
        return cast("TaskName", ENVIRONMENTS[self.env])

    @property
    def gamma(self) -> float:
        """The discount of the algorithm."""
        return self.ppo.gamma if self.algo == "ppo" else self.sac.gamma


def settings_json(settings: Settings) -> dict[str, Any]:
    """Return settings as JSON."""
    return asdict(settings)


def settings_from_json(stored: Mapping[str, Any]) -> Settings:
    """Return the settings that `settings_json` made of them, as `stored` in a folder.

    Raises:
        InputError: a name or value that is not known.
    """
    values = dict(stored)
    known = {one.name for one in fields(Settings)}
    unknown = sorted(set(values) - known)
    if unknown:
        raise InputError(f"settings: no {unknown[0]!r}{did_you_mean(unknown[0], known)}")
    try:
        for name, kind in (("ppo", Ppo), ("sac", Sac)):
            own = dict(values[name])
            own["layers"] = tuple(own["layers"])
            values[name] = kind(**own)
        return Settings(**values)
    except (KeyError, TypeError) as error:
        raise InputError(f"settings: not those of a training run, {error} is missing or wrong") from error


def command_line(settings: Settings, folder: str) -> str:
    """Return the command that trains with these settings into a new folder."""
    words = ["python", "-m", "training.train", "--out", folder]
    usual = asdict(Settings())
    for name, value in asdict(settings).items():
        if name in ("ppo", "sac"):
            for key, own in value.items():
                if own != usual[name][key]:
                    words += [f"--{name}.{key}".replace("_", "-"), *_words(own)]
        elif value != usual[name]:
            words += [f"--{name}".replace("_", "-"), *_words(value)]
    return shlex.join(words)


def _words(value: Any) -> list[str]:
    if isinstance(value, Mapping):
        return [str(part) for pair in value.items() for part in pair]
    return [str(part) for part in value] if isinstance(value, list | tuple) else [str(value)]


def _one_of(name: str, value: str, known: Any) -> None:
    if value not in known:
        raise InputError(f"{name} = {value!r}{did_you_mean(value, known)}, must be {', '.join(known)}")


def _require_within(section: str, given: Ppo | Sac, ranges: Mapping[str, _Range]) -> None:
    for name, (least, most, right) in ranges.items():
        value = getattr(given, name)
        for one in value if isinstance(value, tuple) else (value,):
            if not least <= one <= most:
                raise InputError(f"{section}.{name} = {one}, must be {right}")
