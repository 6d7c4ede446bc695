"""A desk as a reader of the documents has it: files of the checkout, and models where pages expect them.

Many pages begin with the same fit and the same study. What these compute is computed once for each input,
from one start and among few effects; reading, writing and printing are the commands' own every time. Films
end after their first frames.
"""

import functools
import json
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from mecanum_env.effects.catalogue import _EFFECTS
from mecanum_env.files import plain_json
from mecanum_env.model import Model
from mecanum_env.model.effect_names import remove_from_schema
from mecanum_env.rendering import video
from sysid.fit import Fit, FitOptions, pipeline
from sysid.fit.effects import drive
from sysid.gap import workflow
from sysid.gap.result import GapOptions, GapReport
from sysid.logs import Dataset
from tests.docs.blocks import ROOT, call

MODELS = ("fit", "out", "out/fit", ".")
"""Folders in which pages expect a fit of the bundled logs."""
IMPROVED = ("gap", "out/gap")
FRAMES = 10
"""Length of a film here."""
FEW = ("command_deadband", "acceleration_limit")
"""Effects that fits and studies consider here, as long as a page names none; others only take time.
`tests/gap/test_example.py` finds these two among all."""
STARTS = 1
"""Starting points of a fit here, instead of as many as a page asks for; more only take time."""


def once(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that computes each result only once; who is told of progress makes no difference."""
    known: dict[str, Any] = {}

    @functools.wraps(function)
    def remembering(*given: Any, **options: Any) -> Any:
        inputs = [one for one in (*given, *options.items()) if not callable(one)]
        key = json.dumps(plain_json(inputs), default=str)
        if key not in known:
            known[key] = function(*given, **options)
        return known[key]

    return remembering


def fit_once(fit: Callable[..., Fit]) -> Callable[..., Fit]:
    """Return a fit from few starting points, computed once."""
    known = once(fit)

    def remembering(dataset: Dataset, options: FitOptions | None = None, *progress: Any) -> Fit:
        return known(dataset, replace(options or FitOptions(), starts=STARTS), *progress)

    return remembering


def few_candidates(search: Callable[..., dict[str, Any]]) -> Callable[..., dict[str, Any]]:
    """Return a choice of effects for a fit that leaves all but few out."""
    return lambda *logs, **what: {
        name: effect for name, effect in search(*logs, **what).items() if name in FEW
    }


def study_once(analyse: Callable[..., GapReport]) -> Callable[..., GapReport]:
    """Return a study of few effects, computed once wherever the model lies and whatever was before."""
    known = once(analyse)

    def remembering(logs: Any, model: Model, options: GapOptions | None = None, *_: Any) -> GapReport:
        given = options or GapOptions()
        place = {key: value for key, value in model.provenance.items() if key == "logs"}
        few = replace(given, only=given.only or FEW, earlier=(), jobs=1)
        report = known(logs, replace(model, provenance={**model.provenance, "logs": ""}), few)
        provenance = {**report.model.provenance, **place}
        return replace(report, model=replace(report.model, provenance=provenance))

    return remembering


def exchange(name: str, one: Callable[..., Any], other: Callable[..., Any]) -> None:
    """Put a function in the place of another one in every module that holds it by a name.

    A package keeps what it was once asked for (`lazy_loader`), and so do the modules that imported it.
    """
    for module in list(sys.modules.values()):
        if vars(module).get(name) is one:
            setattr(module, name, other)


Quick = Callable[[], AbstractContextManager[None]]
"""What makes commands quick as long as it is entered."""


@pytest.fixture(scope="session")
def quick() -> Quick:
    """Return a context in which no fit and no study is computed twice, and films are short."""
    whole = video.write_video
    stand_ins = (
        ("fit_dataset", pipeline.fit_dataset, fit_once(pipeline.fit_dataset)),
        ("drive_candidates", drive.drive_candidates, few_candidates(drive.drive_candidates)),
        ("analyse", workflow.analyse, study_once(workflow.analyse)),
        ("write_video", whole, lambda path, frames, *fps: whole(path, islice(frames, FRAMES), *fps)),
    )

    @contextmanager
    def quickly() -> Iterator[None]:
        for name, original, stand_in in stand_ins:
            exchange(name, original, stand_in)
        try:
            yield
        finally:
            for name, original, stand_in in stand_ins:
                exchange(name, stand_in, original)

    return quickly


@pytest.fixture(autouse=True)
def _quickly(quick: Quick) -> Iterator[None]:
    with quick():
        yield


@pytest.fixture(scope="session")
def studied(tmp_path_factory: pytest.TempPathFactory, quick: Quick) -> Path:
    """Return a folder with a fit of the bundled logs and the study of the changed ones."""
    folder = tmp_path_factory.mktemp("studied")
    for arguments in (
        ["sysid.fit", f"{ROOT}/examples/logs", "--out", f"{folder}/fit"],
        [
            "sysid.gap",
            f"{ROOT}/examples/gap_logs",
            "--model",
            f"{folder}/fit/model.json",
            "--out",
            f"{folder}/gap",
        ],
    ):
        with quick():
            code, said = call(["python", "-m", *arguments])
        assert code == 0, said
    return folder


@pytest.fixture
def desk(studied: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return a folder to work in, and work there; effects that a page registers are forgotten afterwards."""
    for name in ("examples", "benchmarks", "assets"):
        (tmp_path / name).symlink_to(ROOT / name)
    for folders, kind in ((MODELS, "fit"), (IMPROVED, "gap")):
        for folder in folders:
            shutil.copytree(studied / kind, tmp_path / folder, dirs_exist_ok=True)
    (tmp_path / "drive.csv").write_text(
        "time_s,command_v_rpm,command_theta_deg,command_vc_rpm\n0,80,0,0\n0.5,0,0,40\n", encoding="utf-8"
    )
    monkeypatch.chdir(tmp_path)
    known = set(_EFFECTS)
    yield tmp_path
    for name in set(_EFFECTS) - known:
        remove_from_schema(name)
        del _EFFECTS[name]
