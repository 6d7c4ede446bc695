"""A benchmark's folder with three cases that nobody had to fit: a gain, nothing, and a delay in the truth."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from mecanum_env.files import write_json
from mecanum_env.model import Model, paper_model
from sysid.compare.predicted import predict
from sysid.logs import Dataset, Run
from sysid.logs.runs import BenchCommand
from sysid.studies import score
from sysid.studies.gapbench.bench import write_fixtures
from sysid.studies.gapbench.case_folder import Material, write_case

STEP_S = 0.02


def run_of(model: Model, name: str, split: str, level_rpm: float, seed: int) -> Run:
    time_s = np.arange(0.0, 2.0, STEP_S)
    command = np.where(time_s < 0.2, 0.0, np.where(time_s < 1.2, level_rpm, -level_rpm))
    bare = Run(f"{name}.csv", name, split, time_s, BenchCommand(command), {})
    noise = np.random.default_rng(seed).normal(0.0, 0.5, time_s.size)
    return Run(
        bare.file, name, split, time_s, bare.command, {"speed_rpm": predict(model, bare)["speed_rpm"] + noise}
    )


def three_runs(model: Model, seed: int) -> tuple[Run, ...]:
    splits = ("fit", "validation", "test")
    return tuple(run_of(model, f"run_{i}", s, 30.0 + 20.0 * i, seed + i) for i, s in enumerate(splits))


def material(name: str, changed: Model, hidden: str, parameters: dict[str, float]) -> Material:
    entry = {
        "name": hidden,
        "form": "",
        "effect": hidden,
        "parameters": parameters,
        "neutral": {},
        "signal": 20.0,
    }
    truth = {
        "level": "bench",
        "kind": "single" if hidden else "quiet",
        "hidden": [entry] if hidden else [],
        "outsider": "",
        "twins": [],
        "signal": 20.0 if hidden else 0.0,
    }
    return Material(
        name=name,
        nominal=Dataset("before", three_runs(paper_model(), 10), ()),
        changed=Dataset("after", three_runs(changed, 20), ()),
        test=(run_of(changed, "test_00", "test", 60.0, 30),),
        command_period_s=0.1,
        truth=truth,
        floor_rpm=0.5,
    )


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A benchmark's folder that is shared; do not write into it."""
    folder = tmp_path_factory.mktemp("bench")
    model = paper_model()
    gain = model.with_effect("speed_gain", gain=0.8)
    for one in (
        material("case_000", gain, "speed_gain", {"gain": 0.8}),
        material("case_001", model, "", {}),
        material(
            "case_002", model.with_effect("sensor_latency", delay_s=0.1), "sensor_latency", {"delay_s": 0.1}
        ),
    ):
        write_case(one, model, folder)
    write_fixtures(folder)
    write_json(folder / "gapbench.json", {"version": "0", "commit": "abc", "seeds": "none", "sealed": False})
    assert Path(score.__file__).read_bytes() == (folder / "score.py").read_bytes()
    return folder


@pytest.fixture
def runs_of():
    """Return the function that makes three runs of a model: fit, validation and test."""
    return three_runs


@pytest.fixture
def bench(made: Path, tmp_path: Path) -> Path:
    """A copy of the benchmark's folder."""
    return Path(shutil.copytree(made, tmp_path / "bench"))
