"""Writing the three files of an exported policy."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from mecanum_env.files import require_writable, write_json, write_text
from mecanum_env.model import Model
from mecanum_env.outputs import output_folder
from training.controllers.policy import load_policy
from training.export.c_header import c_header
from training.export.contract import contract_of
from training.export.onnx_graph import onnx_model

_FILES: Final = ("policy.json", "policy.h", "policy.onnx")


def export_policy(
    policy: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    model: Model | None = None,
    *,
    onnx: bool = True,
) -> tuple[Path, ...]:
    """Write `policy.onnx`, `policy.h` and their contract, `policy.json`; return their paths.

    Args:
        policy: file or folder of a trained policy, see `training.controllers.policy.load_policy`.
        folder: folder to write.
        model: the robot that it was trained on; by default the one that the policy's file names.
        onnx: whether to write `policy.onnx`, which needs the `onnx` extra.

    Raises:
        InputError: there is no such policy, its model is not known, or the folder cannot be written.
        BackendError: onnx is not installed.
    """
    contract = contract_of(load_policy(Path(policy)), os.fspath(policy), model)
    names = _FILES if onnx else _FILES[:2]
    paths = tuple(Path(folder) / name for name in names)
    require_writable(*paths)
    with output_folder(folder, "training.export", _FILES) as staged:
        write_json(staged / _FILES[0], contract.to_json())
        write_text(staged / _FILES[1], c_header(contract))
        if onnx:
            (staged / _FILES[2]).write_bytes(onnx_model(contract).SerializeToString())
    return paths
