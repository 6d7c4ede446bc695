"""Blind test cases: what one is, where the generators of their logs are found, and a check of each case.

The generators are in `tests/blind` of a checkout and in no installation. The check replays the logs of a case
with the nominal model and again with the catalogue's effect at its true value, each as the rms of measured
minus simulated over the noise floor. The second number shows how far the mechanism of the hidden simulator
differs from ours.
"""

from __future__ import annotations

import hashlib
import importlib
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal, Protocol, cast

import numpy as np

import mecanum_env
import sysid
from mecanum_env.errors import InputError
from mecanum_env.model import Model
from mecanum_env.simulator import BodyCommands, drive, replay_bench
from mecanum_env.units import FloatArray
from sysid.logs import BodyCommand, Dataset, Run, read_dataset
from sysid.logs.noise import noise_from_repeats

Kind = Literal["single", "pair", "none", "outside", "twin", "untestable"]
Size = Literal["clear", "small", "-"]
Level = Literal["bench", "robot"]


@dataclass(frozen=True)
class Case:
    """One hidden truth, to be found from logs and a nominal model alone."""

    name: str
    level: Level
    kind: Kind
    size: Size
    plant: str
    """The nominal plant, whose logs without any effect give the model."""
    hidden: tuple[str, ...]
    """Names of the hidden effects; for the kind `outside`, a description in words."""
    truth: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Effect -> parameter -> true value, where the catalogue has the effect."""
    twins: tuple[str, ...] = ()
    """Effects that these logs cannot distinguish from the hidden one."""


class BlindTests(Protocol):
    """The generators of the logs in `tests/blind`, which share no code with what is tested."""

    def cases(self, seed: int) -> tuple[Case, ...]:
        """Return every case that a seed defines."""
        ...

    def write_nominal(self, plant: str, folder: Path) -> None:
        """Write logs without effects to `folder`/logs and the known dimensions to `folder`/robot.json."""
        ...

    def write_case(self, name: str, seed: int, folder: Path) -> None:
        """Write the logs of a case to `folder`."""
        ...


def fingerprint() -> str:
    """Return a hash of twelve characters of every source file that an outcome can depend on."""
    package = Path(sysid.__file__).parent
    folders = (package, Path(mecanum_env.__file__).parent, _folder() / "blind")
    digest = hashlib.sha256()
    for folder in folders:
        for path in sorted(p for p in folder.rglob("*") if p.suffix in (".py", ".c", ".h", ".json")):
            digest.update(str(path.relative_to(folder)).encode() + path.read_bytes())
    return digest.hexdigest()[:12]


def blind_tests() -> BlindTests:
    """Return the generators of blind tests of this checkout or of the current folder.

    Raises:
        InputError: the program runs from an installation, which does not contain them.
    """
    tests = str(_folder())
    if tests not in sys.path:
        sys.path.append(tests)
    return cast(BlindTests, importlib.import_module("blind"))


def _folder() -> Path:
    # The second root serves tests that run against an installation, from a copy of the test folder.
    roots = (Path(sysid.__file__).parents[1], Path.cwd())
    folders = [root / "tests" for root in roots if (root / "tests" / "blind" / "__init__.py").is_file()]
    if not folders:
        raise InputError(
            f"{roots[0] / 'tests' / 'blind'}: no such folder; blind tests come with a checkout of the "
            "repository, run them there"
        )
    return folders[0]


@dataclass(frozen=True)
class Check:
    """Residual rms of one case with the nominal model and with the true effects, over the noise floor."""

    case: Case
    before: float
    after: float
    """NaN where the catalogue has no such effect."""

    @property
    def closure(self) -> float:
        """(before - after) / (before - 1), because the noise floor is 1; NaN where there is no gap."""
        return (self.before - self.after) / (self.before - 1.0) if self.before > 1.02 else math.nan

    def row(self) -> str:
        """Return this case as a line of the table."""
        return f"{self.case.name:<52} {self.before:9.3f} {self.after:9.3f} {self.closure:8.3f}"


HEAD = f"{'case':<52} {'before':>9} {'truth':>9} {'closure':>8}"


def check_case(case: Case, seed: int, model: Model) -> Check:
    """Replay the logs of a case of a seed with the nominal model, without and with the true effects."""
    with TemporaryDirectory() as folder:
        blind_tests().write_case(case.name, seed, Path(folder))
        dataset = read_dataset(folder)
    true = model
    for name, values in case.truth.items():
        true = true.with_effect(name, **values)
    before = _misfit(model, dataset)
    return Check(case, before, _misfit(true, dataset) if case.truth else math.nan)


def _misfit(model: Model, dataset: Dataset) -> float:
    """Return the rms of all channels together, in units of the noise of repeats."""
    noise = noise_from_repeats(dataset.runs) or {}
    squares: list[FloatArray] = []
    for runs in dataset.groups().values():
        predicted = _predicted(model, runs[0])
        for run in runs:
            squares += [
                ((run.channels[name] - predicted[name]) / noise[name].std) ** 2 for name in run.channels
            ]
    return math.sqrt(float(np.mean(np.concatenate(squares))))


def _predicted(model: Model, run: Run) -> dict[str, FloatArray]:
    if isinstance(run.command, BodyCommand):
        command = run.command
        commands = BodyCommands(run.time_s, command.v_rpm, command.theta_deg, command.vc_rpm)
        return drive(model, commands, run.duration_s).channels_at(run.time_s)
    return {"speed_rpm": replay_bench(model, run.time_s, run.command.wheels_rpm[:, 0])}
