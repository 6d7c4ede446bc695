"""Running cases: what is saved, what is reused, and what an error does."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import sysid.studies.zoo.__main__ as program
from mecanum_env import checkout
from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.files import write_json
from mecanum_env.parallel import Workers
from sysid.studies.zoo import calibrate, seeds, work
from sysid.studies.zoo import run as zoo_run
from sysid.studies.zoo.cases.case import Case, Driven, Hidden
from sysid.studies.zoo.outcome import Outcome, to_json
from sysid.studies.zoo.sources import fingerprint, sources
from sysid.studies.zoo.work import Task, read_outcome, run_task, run_tasks, save, saved

NAMES = {0: "backlash", 1: "stiction"}


class Bench:
    """Stands for drawing, fit and study, and counts them."""

    def __init__(self) -> None:
        self.drawn: list[int] = []
        self.studied: list[int] = []
        self.errors: dict[str, Exception] = {}

    def write(self, seed: int, folder: Path, driven: Driven) -> Case:
        self.drawn.append(seed)
        (folder / "logs").mkdir()
        (folder / "logs" / "seed").write_text(str(seed))
        self._fail(f"draw {seed}")
        hidden = (Hidden(NAMES[seed % 2], "", {"gap_deg": 2.0}),)
        return Case(seed, "bench", "single", "pi", "steps", "few", hidden, signal=2.0, driven=driven)

    def fit(self, folder: Path) -> Any:
        self._fail(f"fit {(folder / 'logs' / 'seed').read_text()}")
        return None

    def analyse(self, dataset: Any, model: Any, options: Any) -> Any:
        assert model is None
        assert (options.jobs, options.next_experiment) == (1, False)
        seed = int((dataset / "seed").read_text())
        self.studied.append(seed)
        self._fail(f"study {seed}")
        return SimpleNamespace(
            verdict="no_gap",
            effects=(),
            new_effects=(),
            candidates=(),
            gap=SimpleNamespace(before=2.0, after=2.0, noise_floor=1.0),
            gap_beside_fit=None,
            untestable=(),
            smallest_detectable={},
            evidence=(
                SimpleNamespace(effects=("stiction",), misfit=1.5),
                SimpleNamespace(effects=(), misfit=1.6),
            ),
            p_value=0.5,
            trusted=True,
            notes=(),
        )

    def _fail(self, where: str) -> None:
        if where in self.errors:
            raise self.errors[where]


@pytest.fixture
def bench(monkeypatch) -> Bench:
    fake = Bench()
    monkeypatch.setattr(work, "WRITERS", {"bench": fake.write})
    monkeypatch.setattr(work, "nominal_model", fake.fit)
    monkeypatch.setattr(work, "analyse", fake.analyse)
    monkeypatch.setattr(work, "read_dataset", lambda folder: folder)
    return fake


HERE = Workers(jobs=1)
TASKS = [Task("bench", seed) for seed in range(4)]


def test_an_interrupted_run_goes_on_where_it_was(bench, tmp_path, capsys):
    save(TASKS[1], run_task(TASKS[1], fingerprint()), tmp_path / fingerprint())
    assert saved(TASKS[1], tmp_path / fingerprint()).name == "bench-0001.json"
    results = run_tasks(TASKS, tmp_path, HERE)
    assert [outcome.case.seed for outcome in results.outcomes] == [0, 1, 2, 3]
    assert sorted(bench.studied) == [0, 1, 2, 3]
    assert "3 of 4 cases to run, 1 kept from an earlier run" in capsys.readouterr().out
    assert run_tasks(TASKS, tmp_path, HERE) == results
    assert len(bench.studied) == 4


def test_outcomes_of_other_code_are_not_used(bench, tmp_path, capsys, monkeypatch):
    run_tasks(TASKS, tmp_path, HERE)
    before = fingerprint()
    monkeypatch.setattr(work, "fingerprint", lambda: "another")
    work._require_same_code.cache_clear()
    run_tasks(TASKS[:1], tmp_path, HERE)
    assert len(bench.studied) == 5
    assert f"other code in {tmp_path} are not used: {before} (4)" in capsys.readouterr().out
    with pytest.raises(InputError, match="the code changed from"):
        run_task(TASKS[0], before)
    work._require_same_code.cache_clear()


def test_an_error_is_an_outcome_and_stops_no_other_case(bench, tmp_path):
    bench.errors = {"fit 0": InputError("a.csv: nothing moves"), "study 2": ZeroDivisionError("by zero")}
    outcomes = {outcome.case.seed: outcome for outcome in run_tasks(TASKS, tmp_path, HERE).outcomes}
    assert {seed: outcome.verdict for seed, outcome in outcomes.items()} == {
        0: "error",
        1: "no_gap",
        2: "error",
        3: "no_gap",
    }
    assert outcomes[0].message == "fit: a.csv: nothing moves"
    assert outcomes[2].message == "study: ZeroDivisionError: by zero"
    assert outcomes[2].study_s > 0.0


def test_a_case_that_cannot_be_drawn_is_named_and_tried_again(bench, tmp_path):
    bench.errors = {"draw 3": RuntimeError("no size\nshows")}
    results = run_tasks(TASKS, tmp_path, HERE)
    assert len(results.outcomes) == 3
    assert results.undrawn == ("bench-0003: RuntimeError: no size shows",)
    bench.errors = {}
    assert len(run_tasks(TASKS, tmp_path, HERE).outcomes) == 4


def test_cases_that_are_not_asked_for_are_drawn_once_and_not_studied(bench, tmp_path):
    for _ in range(2):
        results = run_tasks(TASKS, tmp_path, HERE, "bench-*-single-backlash")
        assert [outcome.case.seed for outcome in results.outcomes] == [0, 2]
    assert sorted(bench.drawn) == [0, 1, 2, 3]
    assert sorted(bench.studied) == [0, 2]
    assert len(run_tasks(TASKS, tmp_path, HERE).outcomes) == 4
    assert len(run_tasks(TASKS, tmp_path, HERE, "*stiction").outcomes) == 2


def test_cases_of_the_same_commands_are_kept_apart(bench, tmp_path):
    for driven in ("other", "same"):
        (outcome,) = run_tasks([Task("bench", 0, driven)], tmp_path, HERE).outcomes
        assert outcome.case.driven == driven
    assert bench.drawn == [0, 0]


def test_an_outcome_is_read_as_it_was_saved(bench, tmp_path):
    assert bench.drawn == []
    save(TASKS[0], run_task(TASKS[0], fingerprint()), tmp_path)
    made = read_outcome(saved(TASKS[0], tmp_path))
    assert isinstance(made, Outcome)
    assert made.case.name == "bench-0000-single-backlash"
    assert (made.before, made.p_value) == (2.0, 0.5)


def test_the_fingerprint_is_of_what_an_outcome_depends_on():
    names = {name for name, _ in sources()}
    assert {"sysid/studies/zoo/work.py", "sysid/gap/search/thresholds.py", "models/paper.json"} <= names
    assert {"mecanum_env/plugin/mecanum_wheel.c", "sysid/studies/zoo/cases/case.py"} <= names
    assert not {"sysid/studies/zoo/tables.py", "sysid/studies/zoo/__main__.py"} & names
    assert not any(name.startswith("sysid/studies/reproduce") for name in names)


def test_the_command_writes_its_files(bench, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    bench.errors, page = {"study 1": ValueError("no")}, "docs/zoo.md"
    assert run(program.main, ["--bench", "3", "--robot", "0", "--jobs", "1", "--markdown", page]) == 0
    assert "bench-0001-single-stiction: study: ValueError: no" in capsys.readouterr().out
    written = json.loads((tmp_path / "out" / "zoo" / "zoo.json").read_text())
    assert [case["name"][:10] for case in written["cases"]] == ["bench-0000", "bench-0001", "bench-0002"]
    assert written["seeds"] == {"bench": "0-2"}
    assert "python -m sysid.studies.zoo --bench 3 --robot 0" in (tmp_path / "docs" / "zoo.md").read_text()
    assert (tmp_path / "docs" / "zoo_power.png").exists()
    assert "bench-0002" in (tmp_path / "out" / "zoo" / "zoo.txt").read_text()


def test_a_sealed_run_spends_its_seeds_and_goes_on_if_interrupted(bench, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(checkout, "checkout", lambda: tmp_path / "repo")
    monkeypatch.setattr(checkout, "commit", lambda: "abc")
    monkeypatch.setattr(seeds, "changed_files", lambda _root: ())
    sealed = ["--sealed", "--bench", "2", "--robot", "0", "--jobs", "1"]
    with monkeypatch.context() as patch:
        patch.setattr(zoo_run, "run_tasks", interrupt)
        assert run(program.main, sealed) == 130
    ledger = tmp_path / "repo" / seeds.LEDGER
    assert [(b.first, b.commit, b.finished) for b in seeds.read_ledger(ledger)] == [(1000, "abc", False)]
    assert run(program.main, sealed) == 0
    assert run(program.main, sealed) == 0
    assert sorted(bench.studied) == [1000, 1001, 1002, 1003]
    assert [(b.first, b.finished) for b in seeds.read_ledger(ledger)] == [(1000, True), (1002, True)]
    capsys.readouterr()
    assert run(program.main, [*sealed, "--first-seed", "1001"]) == 2
    assert "were spent on" in capsys.readouterr().err


def interrupt(*_: Any) -> None:
    raise KeyboardInterrupt


def test_calibration_reads_development_seeds_of_this_code_alone(bench, tmp_path, capsys):
    folder = tmp_path / fingerprint() / "cases"
    assert run(calibrate.main, [str(tmp_path)]) == 2
    assert "no outcome of a development seed by this code" in capsys.readouterr().err
    for seed in (3, 1000):
        case = Case(seed, "bench", "quiet", "pi", "steps", "few")
        made = Outcome(case, "no_gap", before=2.0, floor=1.0, p_value=0.5)
        write_json(folder / f"bench-{seed:04d}.json", to_json(made))
    assert run(calibrate.main, [str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "above_noise = 4 (sysid/gap/search/thresholds.py, line " in said
    assert "laws leave at most 4 (-inf to inf) in 95 % of 1 quiet studies" in said
    written = json.loads((tmp_path / "calibration.json").read_text())
    assert written["seeds"] == {"bench": "3"}
    assert written["levels"]["bench"]["above_noise"]["value"] == 4.0
    assert bench.studied == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--sealed", "--quick"], "leave out --quick and --only"),
        (["--quick", "--first-seed", "5"], "leave out one of the two"),
        (["--bench", "0", "--robot", "0"], "both 0"),
        (["--bench", "5", "--first-seed", "999"], "reach beyond 999"),
    ],
)
def test_options_that_make_no_sense_are_refused(arguments, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(program.main, arguments) == 2
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
