"""A learner in a checkpoint: tensors and arrays alone, so that opening a foreign one runs none of its code.

agent.zip       tensors of networks and optimisers, read with PyTorch's `weights_only`
normaliser.npz  mean, variance and count of the observations and of the return
replay.npz      SAC's replay buffer, as far as it is filled
"""

from __future__ import annotations

import math
import pickle
import warnings
import zipfile
import zlib
from pathlib import Path
from typing import Any, Final

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.save_util import load_from_zip_file, recursive_getattr, save_to_zip_file
from stable_baselines3.common.vec_env import VecNormalize

from mecanum_env.errors import InputError
from mecanum_env.reading import parse_arrays

AGENT, NORMALISER, REPLAY = "agent.zip", "normaliser.npz", "replay.npz"
_MOMENTS: Final = ("mean", "var", "count")
_BUFFER: Final = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
_UNREADABLE: Final = (
    OSError, EOFError, ValueError, KeyError, TypeError, AttributeError, RuntimeError, AssertionError,
    pickle.UnpicklingError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip


def write_learner(folder: Path, agent: BaseAlgorithm, normaliser: VecNormalize) -> None:
    """Write an agent and its normaliser into a folder that exists."""
    _, variables = agent._get_torch_save_params()
    save_to_zip_file(
        folder / AGENT,
        data=None,
        params=agent.get_parameters(),
        pytorch_variables={name: recursive_getattr(agent, name) for name in variables} or None,
    )
    moments = {f"obs_{name}": getattr(normaliser.obs_rms, name) for name in _MOMENTS}
    moments |= {f"ret_{name}": getattr(normaliser.ret_rms, name) for name in _MOMENTS}
    np.savez(folder / NORMALISER, **moments)
    buffer = getattr(agent, "replay_buffer", None)
    if buffer is not None:
        filled = buffer.buffer_size if buffer.full else buffer.pos
        arrays = {name: getattr(buffer, name)[:filled] for name in _BUFFER}
        np.savez(folder / REPLAY, pos=buffer.pos, full=buffer.full, **arrays)


def read_weights(folder: Path, agent: BaseAlgorithm, normaliser: VecNormalize) -> None:
    """Give an agent the tensors, and a normaliser the statistics, in the folder of a checkpoint.

    Raises:
        InputError: they cannot be read, or are those of another algorithm, network, stack or task.
    """
    try:
        with warnings.catch_warnings():
            # What PyTorch warns of in a foreign file, it refuses next.
            warnings.simplefilter("ignore")
            agent.set_parameters(str(folder / AGENT), exact_match=True, device="cpu")
            _, _, variables = load_from_zip_file(folder / AGENT, load_data=False, device="cpu")
        for name, tensor in (variables or {}).items():
            known = agent._get_torch_save_params()[1]
            own = recursive_getattr(agent, name) if name in known else None
            if own is None or own.shape != tensor.shape:
                raise ValueError(f"another {name}")
            own.data = tensor.data.to(own.device)
        stored = _arrays(folder / NORMALISER)
        for own, prefix in ((normaliser.obs_rms, "obs"), (normaliser.ret_rms, "ret")):
            found = {name: stored[f"{prefix}_{name}"] for name in _MOMENTS}
            if found["mean"].shape != np.shape(own.mean) or found["var"].shape != np.shape(own.var):
                raise ValueError(f"{prefix}_mean has the shape {found['mean'].shape}")
            if not all(np.isfinite(array).all() and array.dtype.kind == "f" for array in found.values()):
                raise ValueError(f"the statistics {prefix} are no finite numbers")
            own.mean, own.var, own.count = found["mean"], found["var"], float(found["count"])
    except _UNREADABLE as error:
        raise _refusal(folder, error) from error


def read_replay(folder: Path, agent: BaseAlgorithm) -> None:
    """Give an agent the replay buffer in the folder of a checkpoint.

    Raises:
        InputError: it cannot be read, or does not fit.
    """
    try:
        stored, buffer = _arrays(folder / REPLAY), agent.replay_buffer
        pos, full = int(stored["pos"]), bool(stored["full"])
        filled = buffer.buffer_size if full else pos
        for name in _BUFFER:
            own, found = getattr(buffer, name), stored[name]
            if found.shape != (filled, *own.shape[1:]) or found.dtype != own.dtype:
                raise ValueError(f"{name} has the shape {found.shape}")
            own[:filled] = found
        if not 0 <= pos <= buffer.buffer_size:
            raise ValueError(f"pos = {pos}")
        buffer.pos, buffer.full = pos, full
    except _UNREADABLE as error:
        raise _refusal(folder, error) from error


def _arrays(path: Path) -> dict[str, Any]:
    with path.open("rb") as file:
        return parse_arrays(file, most=math.inf)


def _refusal(folder: Path, error: BaseException) -> InputError:
    said = " ".join(str(error).split())[:160] or type(error).__name__
    return InputError(
        f"{folder}: not a whole checkpoint with this algorithm, network, stack and task ({said}); remove it "
        "to go on from the one before"
    )
