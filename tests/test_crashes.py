"""A process that dies at any point of what a command writes leaves the old results or the new ones.

The work of each command is replaced by something quick; what writes is the command's own.
"""

import importlib
import importlib.util
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mecanum_env.cli import run
from mecanum_env.files import asset_path, write_text
from mecanum_env.outputs import finish_interrupted, require_whole

_SPEC = importlib.util.spec_from_file_location("crash", Path(__file__).with_name("crash.py"))
crash = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(crash)

PAPER = str(asset_path("models/paper.json"))
text = ["old"]
"""What all files of a run contain."""


def nothing(*_args, **_options) -> None:
    return None


def words(*_args, **_options) -> str:
    return text[0]


def figures(*_args, **_options) -> dict[str, str]:
    return {"text": text[0]}


def file_at(place: int, name: str = "") -> Callable[..., bool]:
    """Return a writer of one file whose path, or folder, is the argument at a place."""

    def write(*args, **_options) -> bool:
        target = Path(args[place]) / name if name else Path(args[place])
        write_text(target, text[0])
        return True

    return write


def study(_report, folder: Path) -> tuple[Path, ...]:
    names = ("gap.json", "model.json", "report.html", *(["next_experiment.csv"] if text[0] == "old" else []))
    for name in names:
        write_text(folder / name, text[0])
    return tuple(folder / name for name in names)


@dataclass
class Found:
    text: str = ""


LOGS = {"sysid.logs.read_dataset": nothing, "sysid.logs.quantities.require_our_units": nothing}
COMMANDS = {
    "fit": ("sysid.fit.__main__", "fit", ["logs"], LOGS | {
        "sysid.fit.pipeline.fit_dataset": nothing,
        "sysid.fit.result.fitted_model": lambda _: SimpleNamespace(),
        "sysid.logs.of_fit.with_logs": nothing,
        "mecanum_env.model.write_model": file_at(1),
        "sysid.fit.result.fit_json": figures,
        "sysid.fit.plots.write_fit_plots": file_at(1, "fit.png"),
        "sysid.fit.report.write_fit_report": file_at(2),
        "sysid.fit.report.fit_table": words,
    }),
    "gap": ("sysid.gap.__main__", "gap", ["logs", "--model", PAPER], {
        "sysid.logs.read_dataset": lambda *_: SimpleNamespace(level="bench"),
        "sysid.logs.quantities.require_our_units": nothing,
        "sysid.gap.search.data.require_valid": nothing,
        "sysid.logs.of_fit.logs_of_fit": lambda *_: (None, ""),
        "sysid.gap.workflow.analyse": nothing,
        "sysid.gap.report.output.write_study": study,
        "sysid.gap.report.output.gap_table": words,
    }),
    "online": ("sysid.online.__main__", "main", ["logs"], {
        "sysid.logs.read_dataset": lambda *_: SimpleNamespace(name="logs"),
        "sysid.online.replay.replay_path": lambda *_: SimpleNamespace(notes=()),
        "sysid.online.replay.replay": lambda *_: [SimpleNamespace(wheel=text[0])],
        "sysid.online.report.report_metrics": nothing,
        "sysid.online.report.online_json": figures,
        "sysid.online.report.save_plot": file_at(0),
        "sysid.online.report.table": words,
        "sysid.online.report.misfit_note": nothing,
    }),
    "certify": ("training.certify.__main__", "main", ["still"], {
        "training.certify.run.episodes_of": lambda *_: 1,
        "training.certify.run.certify_controller": lambda *_: SimpleNamespace(passed=True),
        "training.certify.certificate.write_certificate": file_at(1),
        "training.certify.report.write_certificate_page": file_at(1),
        "training.certify.report.certificate_table": words,
    }),
    "mjcf": ("mecanum_env.mjcf.__main__", "main", [], {
        "mecanum_env.mjcf.plants.mjcf_text": words,
        "mecanum_env.mjcf.plants.left_out": lambda _: {},
        "mecanum_env.mjcf.plants.SPECS": {"robot.xml": nothing, "planar.xml": nothing, "bench.xml": nothing},
    }),
    "plan": ("sysid.logs.__main__", "plan", [], {
        "sysid.logs.plan.layout.make_plan": lambda *_, **__: SimpleNamespace(
            sequences=[SimpleNamespace(name=one, repeats=1) for one in "ab"],
            size=None, errors_percent={"gain": 1.0}, minutes=1.0, noise_rpm=1.0),
        "sysid.logs.plan.protocol.command_columns": lambda *_: {"time_s": np.arange(3.0)},
        "sysid.logs.plan.protocol._settings": words,
        "sysid.logs.plan.protocol.protocol": words,
    }),
    "import": ("sysid.logs.__main__", "import_bags", ["drive.bag", "other.bag"], {
        "sysid.logs.bags.import_bag": lambda *_, **__: SimpleNamespace(
            columns={"time_s": np.arange(3.0)}, choice=SimpleNamespace(topics={}), clock="header"),
        "sysid.logs.reader.read_dataset": nothing,
        "sysid.logs.__main__.describe": words,
    }),
    "paper_gap": ("sysid.studies.paper_gap.__main__", "main", [], {
        "sysid.studies.paper_gap.study.paper_gap": nothing,
        "sysid.studies.paper_gap.tables.paper_gap_json": figures,
        "sysid.studies.paper_gap.tables.paper_gap_markdown": words,
        "sysid.studies.paper_gap.tables.conclusion": words,
    }),
    "reproduce": ("sysid.studies.reproduce.__main__", "main", [], {
        "sysid.studies.reproduce.experiment.reproduce": nothing,
        "sysid.studies.reproduce.pages.reproduction_json": figures,
        "sysid.studies.reproduce.charts.write_reproduction_plots": file_at(1, "starts.png"),
        "sysid.studies.reproduce.pages.write_reproduction_page": file_at(1),
        "sysid.studies.reproduce.tables.verdict": words,
    }),
    "zoo": ("sysid.studies.zoo.__main__", "main", ["--quick"], {
        "sysid.studies.zoo.work.run_tasks": lambda *_: SimpleNamespace(outcomes=(1,), undrawn=()),
        "sysid.studies.zoo.page.provenance_of": nothing,
        "sysid.studies.zoo.page.run_json": figures,
        "sysid.studies.zoo.page.summary_text": words,
        "sysid.studies.zoo.page.short_text": words,
    }),
}  # fmt: skip


@pytest.fixture
def command(request, monkeypatch):
    """Return a function that runs a command, its work replaced, with the output that it is given."""
    module, name, arguments, replaced = request.param
    main = getattr(importlib.import_module(module), name)
    for target, instead in replaced.items():
        place, attribute = target.rsplit(".", 1)
        monkeypatch.setattr(importlib.import_module(place), attribute, instead)

    def work(out: Path, *more: str) -> None:
        assert run(main, [*arguments, "--out", str(out), *more]) == 0

    return work


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS, indirect=True)
def test_a_crash_of_a_command_mixes_nothing(command, tmp_path, request, capsys):
    out = tmp_path / "out"
    fresh = request.node.callspec.id in ("plan", "import")  # these write into new folders only
    states = {}
    for kind in ("old", "new"):
        text[0] = kind
        if not (fresh and kind == "new"):
            command(out)
        if kind == "old":
            (out / "mine.txt").write_text("the user's")
        states[kind] = crash.contents(out)
    if fresh:
        states = {"old": {}, "new": {n: data for n, data in states["old"].items() if n != "mine.txt"}}
    kept = tmp_path / "kept"
    shutil.rmtree(out)
    text[0] = "old"
    if not fresh:
        command(kept)
        (kept / "mine.txt").write_text("the user's")
    seen = set()

    def prepare() -> None:
        shutil.rmtree(out, ignore_errors=True)
        if not fresh:
            shutil.copytree(kept, out)
        text[0] = "old" if fresh else "new"

    def check(at: int) -> None:
        finish_interrupted(out)
        found = crash.contents(out)
        assert found in states.values(), at
        seen.add(next(kind for kind, state in states.items() if state == found))
        for name in found:
            require_whole(out / name)

    assert crash.crash_everywhere(prepare, lambda: command(out), check) > 10
    assert seen == {"old", "new"}
    capsys.readouterr()


FILES = {
    "compare": ("training.compare.__main__", "main", ["still"], {
        "training.compare.comparison.compare_controllers": lambda *_, **__: Found(text[0] * 2000),
        "training.compare.comparison.comparison_table": words,
        "training.compare.comparison.comparison_markdown": lambda *_: text[0] * 2000,
    }, ("a.json", "--markdown", "a.md")),
    "render": ("mecanum_env.render", "render", ["paper"], {
        "mecanum_env.simulator.drive": lambda *_, **__: SimpleNamespace(time_s=np.arange(3.0)),
        "mecanum_env.rendering.video.render_frames": lambda *_: [None],
        "mecanum_env.rendering.video.write_still": file_at(0),
        "mecanum_env.rendering.video.write_video": file_at(0),
    }, ("a.mp4", "--still", "a.png")),
}  # fmt: skip


@pytest.mark.parametrize("kind", FILES)
def test_a_crash_of_a_command_leaves_whole_files(kind, tmp_path, monkeypatch, capsys):
    module, name, arguments, replaced, (first, option, second) = FILES[kind]
    main = getattr(importlib.import_module(module), name)
    for target, instead in replaced.items():
        place, attribute = target.rsplit(".", 1)
        monkeypatch.setattr(importlib.import_module(place), attribute, instead)
    out, other = tmp_path / "out" / first, tmp_path / "out" / second
    given = [*arguments, "--out", str(out), option, str(other)]
    whole = {}
    for one in ("old", "new"):
        text[0] = one
        assert run(main, given) == 0
        whole[one] = crash.contents(out.parent)

    def prepare() -> None:
        shutil.rmtree(out.parent)
        text[0] = "old"
        assert run(main, given) == 0
        text[0] = "new"

    def check(at: int) -> None:
        for path in (out, other):
            assert path.read_bytes() in [whole[one][path.name] for one in ("old", "new")], at

    assert crash.crash_everywhere(prepare, lambda: run(main, given), check) > 4
    capsys.readouterr()
