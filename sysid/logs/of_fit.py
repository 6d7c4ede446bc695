"""The logs that a model was fitted to, which a study compares with: given, or found where the model says."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from mecanum_env.errors import InputError
from mecanum_env.model import Model
from sysid.logs import Dataset, read_dataset
from sysid.logs.runs import Level

_KEY = "logs"
"""Where a model's provenance says which logs it was fitted to, seen from the folder of its file."""


def with_logs(model: Model, logs: Path, folder: Path) -> Model:
    """Return a model whose provenance says where its `logs` lie, for a file in a `folder`."""
    where = os.path.relpath(logs.resolve(), folder.resolve())
    return replace(model, provenance={**model.provenance, _KEY: Path(where).as_posix()})


def seen_from(model: Model, old: Path, new: Path) -> Model:
    """Return a model for a file in a `new` folder, so that it says where its logs lie as in the `old` one."""
    where = model.provenance.get(_KEY)
    return with_logs(model, old / where, new) if isinstance(where, str) else model


def logs_of_fit(model: Model, folder: Path, level: Level) -> tuple[Dataset | None, str]:
    """Return the logs that a model was fitted to, and why there are none, as a sentence.

    `folder` is that of the model's file. They are only taken if they are the same as when the model was
    fitted, and of the same `level` as the logs of the study: a model of a wheel on the bench may well be
    compared with its robot on the floor.
    """
    where, known = model.provenance.get(_KEY), model.provenance.get("data_sha256")
    if not isinstance(where, str):
        return None, ""
    path = Path(os.path.normpath(folder / where))
    try:
        found = read_dataset(path)
    except InputError:
        return None, f"the logs of the fit are not at {path}: give them with --fitted-on to compare with them"
    if found.sha256 != known:
        return None, f"{path} has changed since the model was fitted: no comparison with the logs of the fit"
    if found.level != level:
        return None, f"the logs of the fit are {found.level} logs, and these are {level} logs: no comparison"
    return found, ""
