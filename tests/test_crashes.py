"""A process that dies at any point of what a command writes leaves the old results or the new ones.

The work of each command is replaced by something quick; what writes is the command's own.
"""

import ast
import importlib
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from mecanum_env.cli import run
from mecanum_env.files import asset_path, write_text
from mecanum_env.outputs import finish_interrupted, require_whole
from sysid.studies.gapbench.__main__ import make
from sysid.studies.gapbench.__main__ import run as answer
from sysid.studies.gapbench.cases import Answer
from tests import crash

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


def datasets(*names: str) -> Callable[..., None]:
    """Return a writer of files in the folder that is its second argument."""

    def write(_data, folder: Path, *_options) -> None:
        for name in names:
            write_text(folder / name, text[0])

    return write


def study(_report, folder: Path) -> tuple[Path, ...]:
    names = ("gap.json", "model.json", "report.html", *(["next_experiment.csv"] if text[0] == "old" else []))
    for name in names:
        write_text(folder / name, text[0])
    return tuple(folder / name for name in names)


@dataclass
class Found:
    text: str = ""


@dataclass
class Report:
    model: None = None


LOGS = {"sysid.logs.read_dataset": nothing, "sysid.logs.quantities.require_our_units": nothing}
COMMANDS = {
    "fit": ("sysid.fit.__main__", "fit", ["logs"], LOGS | {
        "sysid.fit.pipeline.fit_dataset": nothing,
        "sysid.fit.report.fitted_model": lambda _: SimpleNamespace(),
        "sysid.logs.of_fit.with_logs": nothing,
        "mecanum_env.model.write_model": file_at(1),
        "sysid.fit.report.fit_json": figures,
        "sysid.fit.report.write_fit_plots": file_at(1, "fit.png"),
        "sysid.fit.report.write_fit_report": file_at(2),
        "sysid.fit.report.fit_table": words,
    }),
    "gap": ("sysid.gap.__main__", "gap", ["logs", "--model", PAPER], {
        "sysid.logs.read_dataset": lambda *_: SimpleNamespace(level="bench"),
        "sysid.logs.quantities.require_our_units": nothing,
        "sysid.gap.search.checks.require_valid": nothing,
        "sysid.logs.of_fit.logs_of_fit": lambda *_: (None, ""),
        "sysid.gap.workflow.analyse": lambda *_: Report(),
        "sysid.logs.of_fit.seen_from": nothing,
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
    "import": ("sysid.logs.__main__", "import_logs", ["drive.bag", "other.bag"], {
        "sysid.logs.formats.sources.import_source": lambda source, *_, **__: [
            SimpleNamespace(name=source.stem, columns={"time_s": np.arange(3.0)}, said="words")],
        "sysid.logs.reader.read_dataset": nothing,
        "sysid.logs.describe.describe": words,
        "sysid.logs.describe.dataset_json": nothing,
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
        "sysid.studies.zoo.run.run_tasks": lambda *_: SimpleNamespace(outcomes=(1,), undrawn=()),
        "sysid.studies.zoo.page.provenance_of": nothing,
        "sysid.studies.zoo.run.run_json": figures,
        "sysid.studies.zoo.run.summary_text": words,
        "sysid.studies.zoo.page.short_text": words,
    }),
    "compare": ("training.compare.__main__", "main", ["p", "--markdown", "OUT/a.md", "--out", "OUT/a.json"], {
        "training.compare.comparison.compare_controllers": lambda *_, **__: Found(text[0]),
        "training.compare.report.comparison_table": words,
        "training.compare.report.comparison_markdown": words,
    }),
    "render": ("mecanum_env.render", "render", ["paper", "--still", "OUT/a.png", "--out", "OUT/a.mp4"], {
        "mecanum_env.simulator.drive": lambda *_, **__: SimpleNamespace(time_s=np.arange(3.0)),
        "mecanum_env.rendering.video.render_frames": lambda *_: [None],
        "mecanum_env.rendering.video.write_still": file_at(0),
        "mecanum_env.rendering.video.write_video": file_at(0),
    }),
    "record": ("training.record.__main__", "main", ["still", "--still", "OUT/a.png", "--out", "OUT/a.mp4"], {
        "training.record.film.robot_variants": nothing,
        "training.record.film.select_variants": lambda *_: [
            SimpleNamespace(name="nominal", group="", model=None, physics="rollers", randomize="none")],
        "training.record.film.TankendoEnv": lambda **_: SimpleNamespace(
            arena=SimpleNamespace(time_limit_s=1.0)),
        "training.record.film.make_controller": nothing,
        "training.record.film.rollout_frames": lambda *_, **__: [None],
        "training.record.film.outcome": words,
        "mecanum_env.rendering.video.write_still": file_at(0),
        "mecanum_env.rendering.video.write_video": lambda path, frames, _: [*frames] and file_at(0)(path),
    }),
    "policy": ("training.export.__main__", "export", ["robust", "--formats", "c"], {
        "training.export.write.contract_of": lambda *_: SimpleNamespace(to_json=figures),
        "training.export.write.c_header": words,
    }),
    "simulate": ("sysid.simulate", "simulate", ["logs", "--model", PAPER], {
        "sysid.logs.read_dataset": lambda *_: SimpleNamespace(name="logs", runs=()),
        "sysid.logs.writer.write_dataset": datasets("a.csv", "dataset.toml"),
        "sysid.simulate.replace": lambda one, **_: one,
    }),
    "export": ("sysid.logs.__main__", "export", ["logs", "--to", "lerobot"], {
        "sysid.logs.reader.read_dataset": lambda *_: SimpleNamespace(runs=()),
        "sysid.logs.formats.lerobot.write_lerobot": datasets("meta/info.json", "data/a.parquet"),
    }),
}  # fmt: skip
FRESH = ("plan", "import", "simulate", "export")
"""Commands that write into new folders only."""


def load_what_is_imported_late(program: ModuleType) -> None:
    """Import what a program imports when it runs, lest a module keep for good what is replaced here."""
    for node in ast.walk(ast.parse(Path(program.__file__).read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module != "__future__":
            imported = importlib.import_module(node.module)
            for alias in node.names:
                getattr(imported, alias.name, None)


@pytest.fixture
def command(request, monkeypatch):
    """Return a function that runs a command, its work replaced, with the output that it is given."""
    module, name, arguments, replaced = request.param
    program = importlib.import_module(module)
    load_what_is_imported_late(program)
    places = [
        (importlib.import_module(place), rest) for place, rest in (one.rsplit(".", 1) for one in replaced)
    ]
    for (place, attribute), instead in zip(places, replaced.values(), strict=True):
        monkeypatch.setattr(place, attribute, instead)
    main = getattr(program, name)

    def work(out: Path) -> None:
        given = [*arguments, *([] if "--out" in arguments else ["--out", "OUT"])]
        assert run(main, [word.replace("OUT", str(out)) for word in given]) == 0

    return work


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS, indirect=True)
def test_a_crash_of_a_command_mixes_nothing(command, tmp_path, request, capsys):
    out = tmp_path / "out"
    fresh = request.node.callspec.id in FRESH
    states, text[0] = {"old": {}}, "old"
    if not fresh:
        command(out)
        (out / "mine.txt").write_text("the user's")
        states["old"] = crash.contents(out)
    text[0] = "new"
    found: list[dict[str, bytes]] = []

    def check(_at: int) -> None:
        finish_interrupted(out)
        found.append(crash.contents(out))
        for name in found[-1]:
            require_whole(out / name)

    def work() -> None:
        command(out)
        states["new"] = crash.contents(out)

    assert crash.crash_everywhere(work, check, out) > 10
    assert states["new"] != states["old"]
    assert all(one in states.values() for one in found)
    assert all(one in found for one in states.values())
    capsys.readouterr()


CASES = ("case_000", "case_001")


def test_a_crash_of_gapbench_leaves_whole_cases(tmp_path, monkeypatch, capsys):
    """Making goes on after a crash: what is there is whole, and the next run adds what is missing."""
    module = "sysid.studies.gapbench.bench"
    monkeypatch.setattr(f"{module}.simulated_case", lambda _, name: SimpleNamespace(name=name, nominal=None))
    monkeypatch.setattr(f"{module}.fit_dataset", nothing)
    monkeypatch.setattr(f"{module}.fitted_model", nothing)
    monkeypatch.setattr(f"{module}.write_fixtures", file_at(0, "score.py"))

    def write_case(material, _model, bench: Path) -> None:
        for part in ("cases/{}/case.json", "truth/{}/truth.json"):
            write_text(bench / part.format(material.name), material.name)

    monkeypatch.setattr(f"{module}.write_case", write_case)
    out = tmp_path / "out"
    text[0] = "fixed"

    def work() -> None:
        assert run(make, ["--out", str(out), "--bench", str(len(CASES))]) == 0

    def check(_at: int) -> None:
        finish_interrupted(out)
        found = crash.contents(out)
        whole = [f"cases/{name}/case.json" in found for name in CASES]
        assert whole == [f"truth/{name}/truth.json" in found for name in CASES]
        # Other seeds are refused as soon as there is a case.
        assert "gapbench.json" in found or not any(whole)
        if whole not in begun:
            begun.append(whole)
            work()
            assert crash.contents(out).keys() == complete

    begun: list[list[bool]] = []
    work()
    complete = crash.contents(out).keys()
    shutil.rmtree(out)
    assert crash.crash_everywhere(work, check, out) > 50
    assert begun == [[False, False], [True, False], [True, True]]
    capsys.readouterr()


def test_a_crash_of_a_method_of_gapbench_leaves_whole_answers(tmp_path, monkeypatch, capsys):
    module, answers = "sysid.studies.gapbench.run", tmp_path / "answers" / "always_no_gap"
    monkeypatch.setattr(f"{module}.read_case", lambda folder: SimpleNamespace(name=folder.name))
    monkeypatch.setattr(f"{module}.load", lambda _: lambda _: Answer("no_gap"))
    monkeypatch.setattr(f"{module}.write_predictions", lambda *given: write_text(given[2] / "a.csv", "0"))
    for name in CASES:
        write_text(tmp_path / "cases" / name / "case.json", "{}")

    def work() -> None:
        given = ["--cases", str(tmp_path / "cases"), "--out", str(answers.parent)]
        assert run(answer, [*given, "--adapters", answers.name]) == 0

    def check(_at: int) -> None:
        finish_interrupted(answers)
        found = crash.contents(answers)
        whole = [f"cases/{name}.json" in found for name in CASES]
        assert whole == [f"predictions/{name}/a.csv" in found for name in CASES]
        assert all(whole) or "answers.json" not in found
        for name in found:
            require_whole(answers / name)

    assert crash.crash_everywhere(work, check, answers) > 50
    assert set(json.loads((answers / "answers.json").read_text())["cases"]) == set(CASES)
    capsys.readouterr()
