"""A trained policy as a controller, with NumPy alone: what a robot's computer runs.

A policy file (`.npz`, written by `training.train`) holds the observation normaliser, the layers of the
network and, as JSON, what it was trained for. Nothing in it is pickled.

    controller = load_policy(bundled())
    controller.reset()
    v, theta, vc = controller.act(observation)  # every 0.1 s

The network sees features of the observation in which a strike stands out (`training.controllers.features`).
"""

from __future__ import annotations

import io
import json
import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.files import atomic_path
from mecanum_env.outputs import require_whole
from mecanum_env.reading import parse_arrays, parse_json, read_bytes
from mecanum_env.tankendo import Rules
from mecanum_env.tankendo.actions import ActionMode, action_to_command, check_mode
from mecanum_env.units import FloatArray
from training.controllers.features import EXTRA_FEATURES, KEPT, features, stack_features
from training.controllers.interface import Command

FORMAT: Final = "mecanum-policy/1"
_DEFAULT: Final = "predicting"
"""Name of the default bundled policy."""
_FOLDER: Final = Path(__file__).parent.parent / "policies"
_HINT: Final = "give policy.npz of a folder that `python -m training.train` wrote"
_ACTION: Final = 3
"""Size of an action."""
_ACTIVATIONS: Final[Mapping[str, Callable[[FloatArray], FloatArray]]] = {
    "tanh": np.tanh,
    "relu": lambda x: np.maximum(x, 0.0),
}
"""Name -> activation function between the layers."""


@dataclass(frozen=True)
class Network:
    """The deterministic policy: features of the latest observations in, an action out.

    With x the features of the last `stack` observations, oldest first: x is normalised to
    clip((x - mean) / scale, +-clip), passes the layers W x + b with the activation in between, and the result
    goes through tanh if `squashes`, else it is clipped to [-1, 1].
    """

    mean: FloatArray
    """Mean of each number of x, shape (stack * k,)."""
    scale: FloatArray
    """Divisor of each number of x - mean, shape (stack * k,)."""
    clip: float
    """Largest absolute value of a normalised number."""
    weights: tuple[FloatArray, ...]
    """W of each layer, shape (outputs, inputs)."""
    biases: tuple[FloatArray, ...]
    """b of each layer, shape (outputs,)."""
    activation: str
    """Name of the function between the layers, from `_ACTIVATIONS`."""
    squashes: bool
    """Whether tanh, instead of a clip, keeps actions within [-1, 1]."""
    action_mode: ActionMode
    """Meaning of an action; see `mecanum_env.tankendo.actions`."""
    stack: int
    """Number of observations in x."""
    privileged: int = 0
    """How many numbers that no robot senses follow them: then it is no policy, but the teacher of one."""
    has_time_to_cut: bool = False
    """Whether the features of an observation end with `time_to_cut`."""

    @property
    def feature_count(self) -> int:
        """Number of features of one observation."""
        return (len(self.mean) - self.privileged) // self.stack

    @property
    def observation_size(self) -> int:
        """Size of one observation."""
        return self.feature_count - EXTRA_FEATURES - self.has_time_to_cut

    def features(self, observation: npt.NDArray[np.floating], maai_m: float = Rules.maai_m) -> FloatArray:
        """Return what it sees of one or more observations, shape (..., k): their features, shape (..., f)."""
        return features(observation, maai_m, has_time_to_cut=self.has_time_to_cut)

    def actions(self, stacked: npt.NDArray[np.floating]) -> FloatArray:
        """Return actions within [-1, 1], shape (..., 3), of stacked features, shape (..., stack * k)."""
        x = np.clip((np.asarray(stacked, float) - self.mean) / self.scale, -self.clip, self.clip)
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = (_ACTIVATIONS[self.activation](x) if layer else x) @ weight.T + bias
        return np.tanh(x) if self.squashes else np.clip(x, -1.0, 1.0)


class Policy:
    """A trained policy as a controller; it remembers as many observations as its network sees.

    `about` says what it was trained for and with, as in its file. By default it plays by the usual rules.
    """

    def __init__(self, network: Network, about: Mapping[str, Any], rules: Rules | None = None) -> None:
        self.network, self.about = network, about
        self.maai_m = (Rules() if rules is None else rules).maai_m
        """Striking distance that its features count from [m]."""
        # A robot takes whole numbers, whatever quantum the model was trained with.
        self.quantum_rpm = max(float(about.get("command_quantum_rpm", 1.0)), 1.0)
        """V and VC are multiples of this [rpm]."""
        self.reset()

    def reset(self) -> None:
        """Forget the episode."""
        self._memory: FloatArray | None = None

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (k,).

        Raises:
            InputError: the policy was trained on observations of another length.
        """
        seen = np.asarray(observation, float)
        size = self.network.observation_size
        if seen.shape != (size,):
            raise InputError(
                f"observation of shape {seen.shape}, must be ({size},): this policy was trained for "
                f"{self.about.get('env', 'another task')}"
            )
        self._memory = stack_features(
            self._memory, self.network.features(seen, self.maai_m), self.network.stack
        )
        action = self.network.actions(self._memory)
        v, theta, vc = action_to_command(action, self.network.action_mode, self.quantum_rpm)
        return round(float(v)), round(float(theta)), round(float(vc))


def bundled(name: str = _DEFAULT) -> Path:
    """Return a policy file that comes with the package; its card is beside it (`.md`).

    Raises:
        InputError: there is no bundled policy of this name.
    """
    known = policy_names()
    if name not in known:
        raise InputError(f"bundled policy {name!r}{did_you_mean(name, known)}, must be {', '.join(known)}")
    return _FOLDER / f"{name}.npz"


def policy_names() -> tuple[str, ...]:
    """Return the names of the policies that come with the package."""
    return tuple(sorted(path.stem for path in _FOLDER.glob("*.npz")))


def policy_path(name: str) -> Path | None:
    """Return where the policy is that programs call `name`; None if that is not the name of a policy.

    `policy` and the names of bundled policies come before files (`.npz`) and folders of the same name.
    """
    if name == "policy":
        return bundled()
    if name in policy_names():
        return bundled(name)
    path = Path(name)
    return path if name and (path.suffix == ".npz" or path.is_dir()) else None


def load_policy(path: Path, rules: Rules | None = None) -> Policy:
    """Return the policy in a file, ready to act.

    The path is that of an `.npz` or a folder that `training.train` wrote, or `bundled()`. The default rules
    are the usual ones.

    Raises:
        InputError: there is no such file, or it holds no policy for a robot.
    """
    network, about = load_network(path)
    if network.privileged:
        raise InputError(f"{path}: a teacher, which sees what no robot senses; give a policy it has taught")
    try:
        policy = Policy(network, about, rules)
        _try_out(policy)
    except (TypeError, ValueError, OverflowError, MemoryError) as error:
        raise InputError(f"{path}: no policy that can act ({error}); {_HINT}") from error
    return policy


def load_network(path: Path) -> tuple[Network, Mapping[str, Any]]:
    """Return the network in a file or folder, that of a policy or a teacher, and what it was trained for.

    Raises:
        InputError: there is no such file, or it holds none.
    """
    if os.path.isdir(path):
        path = path / "policy.npz"
    require_whole(path)
    if not os.path.exists(path):
        raise InputError(f"{path}: no such policy; `python -m training.train --out RUN` writes one")
    try:
        arrays = parse_arrays(io.BytesIO(read_bytes(path, _HINT)))
    except ValueError as error:
        raise InputError(f"{path}: no policy file, or a torn one; {_HINT}") from error
    try:
        try:
            about = parse_json(str(arrays["about"]), "about")
        except InputError as error:
            raise KeyError("about") from error
        if about["format"] != FORMAT:
            raise InputError(f'format = {about["format"]!r}, must be "{FORMAT}"; export it again')
        return _network(arrays, about), about
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: no policy file, though it holds arrays; {_HINT}") from error
    except (ValueError, OverflowError, MemoryError) as error:
        raise InputError(f"{path}: no policy that can act ({error}); {_HINT}") from error


def _try_out(policy: Policy) -> None:
    """Refuse a policy that cannot act, at load and not on the robot."""
    observation = np.zeros(policy.network.observation_size)
    with np.errstate(over="ignore", invalid="ignore"):
        command = policy.act(observation)
        action = policy.network.actions(np.tile(policy.network.features(observation), policy.network.stack))
    policy.reset()
    if not (np.isfinite(action).all() and np.isfinite(command).all()):
        raise ValueError("its first action is not finite")


def save_policy(path: Path, network: Network, about: Mapping[str, Any]) -> None:
    """Write a policy to an `.npz` file; `about` says in JSON what it was trained for and with."""
    same = ("clip", "activation", "squashes", "action_mode", "stack", "privileged", "has_time_to_cut")
    shape = {"format": FORMAT, "layers": len(network.weights)} | {n: getattr(network, n) for n in same}
    arrays: dict[str, Any] = {"mean": network.mean, "scale": network.scale}
    for layer, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        # Training uses single precision, too.
        arrays[f"weight_{layer}"] = weight.astype(np.float32)
        arrays[f"bias_{layer}"] = bias.astype(np.float32)
    text = json.dumps({**about, **shape}, indent=1, allow_nan=False)
    with atomic_path(path) as temporary:
        np.savez_compressed(temporary, about=np.array(text), **arrays)


def _network(arrays: Mapping[str, npt.NDArray[Any]], about: Mapping[str, Any]) -> Network:
    numbers = (("layers", about["layers"], 1), ("stack", about["stack"], 1))
    for name, value, least in (*numbers, ("privileged", about.get("privileged", 0), 0)):
        if type(value) is not int or value < least:
            raise InputError(f"{name} = {value!r}, must be a whole number of at least {least}")
    for name, given in (
        ("squashes", about["squashes"]),
        ("has_time_to_cut", about.get("has_time_to_cut", False)),
    ):
        if not isinstance(given, bool):
            raise InputError(f"{name} = {given!r}, must be true or false")
    for name, array in arrays.items():
        if name != "about" and array.dtype.kind not in "fiu":
            raise InputError(f"{name} holds {array.dtype}, must be real numbers")
    layers = range(about["layers"])
    network = Network(
        mean=arrays["mean"].astype(float),
        scale=arrays["scale"].astype(float),
        clip=float(about["clip"]),
        weights=tuple(arrays[f"weight_{layer}"].astype(float) for layer in layers),
        biases=tuple(arrays[f"bias_{layer}"].astype(float) for layer in layers),
        activation=about["activation"],
        squashes=about["squashes"],
        action_mode=about["action_mode"],
        stack=about["stack"],
        privileged=about.get("privileged", 0),
        has_time_to_cut=about.get("has_time_to_cut", False),
    )
    check_mode(network.action_mode)
    if network.activation not in _ACTIVATIONS:
        raise InputError(
            f"activation = {network.activation!r}, must be {', '.join(_ACTIVATIONS)}; export the policy again"
        )
    sizes = [len(network.mean), *map(len, network.biases)]
    shapes = [weight.shape for weight in network.weights]
    if shapes != list(zip(sizes[1:], sizes[:-1], strict=True)) or network.scale.shape != network.mean.shape:
        raise ValueError(f"layers of shapes {shapes} do not fit {len(network.mean)} inputs")
    if not 0.0 < network.clip < math.inf or not np.all(network.scale > 0.0):
        raise ValueError("clip and scale must be above 0")
    if (len(network.mean) - network.privileged) % network.stack or network.observation_size <= KEPT:
        raise ValueError(f"{len(network.mean)} inputs are no {network.stack} observations")
    if sizes[-1] != _ACTION:
        raise ValueError(f"the last layer has {sizes[-1]} outputs, must be {_ACTION}")
    if not all(np.isfinite(array).all() for name, array in arrays.items() if name != "about"):
        raise ValueError("a number is not finite")
    return network
