"""Policies to export: the bundled one, and small ones of every kind of network and action."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from mecanum_env.tankendo.constants import GUARD_TIP_M
from mecanum_env.tankendo.observation import LIMITS
from mecanum_env.tankendo.sword import GUARD_HEIGHT_M
from training.controllers.features import EXTRA_FEATURES, FAR_S, WAY_DIRECTIONS, WAY_LENGTHS_M, time_to_cut
from training.controllers.policy import Network, bundled, load_policy, save_policy
from training.export import export_policy

OBSERVATIONS = 1000
KINDS = ("robust", "tanh, polar", "relu, command, three in the stack", "duel", "time to cut")


@dataclass(frozen=True)
class Exported:
    """A policy's own actions and commands on observations that follow each other, and its exported files."""

    folder: Path
    observations: np.ndarray
    actions: np.ndarray
    commands: np.ndarray
    stack: int


def small_network(
    mode: str, activation: str, stack: int, size: int, *, has_time_to_cut: bool = False
) -> Network:
    rng = np.random.default_rng(7)
    inputs = stack * (size + EXTRA_FEATURES + has_time_to_cut)
    sizes = (inputs, 24, 16, 3)
    layers = list(zip(sizes[1:], sizes[:-1], strict=True))
    return Network(
        mean=rng.normal(size=inputs),
        scale=rng.uniform(0.3, 3.0, inputs),
        clip=10.0,
        weights=tuple(rng.normal(size=shape).astype(np.float32) / np.sqrt(shape[1]) for shape in layers),
        biases=tuple(rng.normal(size=shape[0]).astype(np.float32) for shape in layers),
        activation=activation,
        squashes=activation == "relu",
        action_mode=mode,
        stack=stack,
        has_time_to_cut=has_time_to_cut,
    )


def policy_file(kind: str, folder: Path) -> Path:
    if kind == "robust":
        return bundled("robust")
    network = {
        "tanh, polar": small_network("polar", "tanh", 1, 20),
        "relu, command, three in the stack": small_network("command", "relu", 3, 20),
        "duel": small_network("cartesian", "tanh", 2, 23),
        "time to cut": small_network("cartesian", "tanh", 2, 20, has_time_to_cut=True),
    }[kind]
    save_policy(folder / "policy.npz", network, {"env": "a test"})
    return folder / "policy.npz"


def raise_swords(seen: np.ndarray, rng: np.random.Generator) -> None:
    """Let the opponents of observations (n, k) draw their swords, somewhere on the way and at some rate."""
    ways = (WAY_DIRECTIONS * WAY_LENGTHS_M[:, None])[rng.integers(len(WAY_LENGTHS_M), size=len(seen))]
    share, rate = rng.uniform(0.05, 0.95, len(seen)), rng.uniform(1.0, 8.0, len(seen))
    towards = -seen[:, :2] / np.linalg.norm(seen[:, :2], axis=1, keepdims=True)
    seen[:, 4:6] = seen[:, :2] + (GUARD_TIP_M + share * ways[:, 0])[:, None] * towards
    seen[:, 6] = GUARD_HEIGHT_M + share * ways[:, 1]
    seen[:, 7:9] = seen[:, 2:4] + (rate * ways[:, 0])[:, None] * towards
    seen[:, 9] = rate * ways[:, 1]
    left = time_to_cut(seen)
    assert np.mean((left > 0.0) & (left < FAR_S)) > 0.7


@pytest.fixture(scope="module", params=KINDS)
def exported(request, tmp_path_factory):
    """Return each kind of policy, exported, with what it does on a thousand observations."""
    folder = tmp_path_factory.mktemp("exported")
    path = policy_file(request.param, folder)
    try:
        import onnx  # noqa: F401
    except ImportError:
        export_policy(path, folder, onnx=False)
    else:
        export_policy(path, folder)
    policy = load_policy(path)
    size = policy.network.observation_size
    rng = np.random.default_rng(3)
    limits = np.concatenate([LIMITS, np.full(size - len(LIMITS), 2.0)])
    # Half of them as in a fight, the others anywhere within the limits of the sensors; of the first, every
    # second one with a sword that rises.
    spread = np.where(np.arange(OBSERVATIONS)[:, None] % 2, limits, np.minimum(limits, 1.5))
    seen = rng.uniform(-1.0, 1.0, (OBSERVATIONS, size)) * spread
    raise_swords(seen[::4], rng)
    seen = seen.astype(np.float32).astype(float)
    actions, commands = [], []
    for one in seen:
        commands.append(policy.act(one))
        actions.append(policy.network.actions(policy._memory))
    return Exported(folder, seen, np.array(actions), np.array(commands), policy.network.stack)
