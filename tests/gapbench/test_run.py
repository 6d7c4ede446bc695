"""Methods on a tiny benchmark: their answers, and the leaderboard made of them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from mecanum_cli.__main__ import main as mecanum
from mecanum_env.errors import InputError
from mecanum_env.model import paper_model
from sysid.logs import read_dataset
from sysid.studies.gapbench.__main__ import main
from sysid.studies.gapbench.adapters.friction_bic import answer as friction
from sysid.studies.gapbench.adapters.registry import ADAPTERS, load
from sysid.studies.gapbench.cases import read_case
from sysid.studies.gapbench.names import EQUATIONS, named_effects
from sysid.studies.gapbench.real import real_cases
from sysid.studies.gapbench.run import run_adapters
from sysid.studies.gapbench.simulated import simulated_case

TRIVIAL = ("always_no_gap", "most_frequent_name")


def test_every_name_that_can_be_hidden_has_an_equation():
    assert {effect.name for effect in named_effects()} == EQUATIONS.keys()


def test_answers_become_a_leaderboard(made, tmp_path, capsys):
    given = ["gapbench", "run", "--cases", str(made / "cases"), "--out", str(tmp_path / "answers")]
    assert mecanum([*given, "--adapters", *TRIVIAL, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert set(said["found"]["seconds"]) == set(TRIVIAL)
    assert set(said["results"]["answers.json"]["cases"]) == {"case_000", "case_001", "case_002"}
    page = tmp_path / "page.md"
    answers = ["--answers", str(tmp_path / "answers")]
    assert main(["leaderboard", "--bench", str(made), *answers, "--markdown", str(page)]) == 0
    assert "| always_no_gap | 33 %" in capsys.readouterr().out
    text = page.read_text(encoding="utf-8")
    assert "Not run: ours" in text
    assert "| most_frequent_name |" in text
    assert mecanum(["gapbench", "leaderboard", "--bench", str(made), *answers, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["found"]
    assert found["always_no_gap"]["right answers"]["value"] == pytest.approx(1 / 3)


def test_an_answer_is_kept_and_an_error_is_an_answer(made, tmp_path, monkeypatch):
    def broken(_case):
        raise ValueError("no\nluck")

    monkeypatch.setattr("sysid.studies.gapbench.run.load", lambda _name: broken)
    run_adapters(made / "cases", tmp_path, ("always_no_gap",))
    monkeypatch.undo()
    run_adapters(made / "cases", tmp_path, ("always_no_gap",))
    said = json.loads((tmp_path / "always_no_gap/answers.json").read_text(encoding="utf-8"))["cases"]
    assert said["case_000"]["verdict"] == "error"
    assert said["case_000"]["message"] == "ValueError: no luck"


def test_an_unknown_method_is_refused_with_the_known_ones(made, tmp_path):
    with pytest.raises(InputError, match="known: ours"):
        run_adapters(made / "cases", tmp_path, ("our",))


@pytest.mark.parametrize("name", sorted(ADAPTERS))
def test_every_method_has_a_module(name):
    if ADAPTERS[name].missing():
        pytest.skip(ADAPTERS[name].missing())
    assert callable(load(name))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", sorted(ADAPTERS.keys() - TRIVIAL))
def test_a_method_answers_and_predicts(made, name):
    if ADAPTERS[name].missing():
        pytest.skip(ADAPTERS[name].missing())
    case = read_case(made / "cases/case_000")
    said = load(name)(case)
    assert said.verdict in ("named", "ambiguous", "unexplained", "no_gap")
    assert [speed.size for speed in said.predictions] == [case.test[0].time_s.size] * len(said.predictions)


def test_a_case_is_read_as_it_was_written(made):
    case = read_case(made / "cases/case_000")
    assert [run.split for run in case.changed.runs] == ["fit", "validation", "test"]
    assert case.model.wheel == paper_model().wheel
    assert "speed_rpm" not in case.test[0].channels
    assert case.test[0].command.wheels_rpm.max() == 60.0


def test_friction_is_found_by_the_criterion_and_nothing_where_nothing_changed(made, runs_of):
    case = read_case(made / "cases/case_001")
    assert friction(case).verdict == "no_gap"
    rough = paper_model().with_effect("coulomb_friction", torque_n_m=5.0)
    found = friction(replace(case, changed=replace(case.changed, runs=runs_of(rough, 40))))
    assert set(found.effects) == {"coulomb_friction"}
    assert len(found.predictions[0]) == case.test[0].time_s.size


def test_pairs_of_recordings_become_cases(made, tmp_path):
    folder = tmp_path / "mine"
    folder.mkdir()
    for part in ("nominal", "changed"):
        (folder / part).symlink_to(made / "cases/case_000" / part)
    pairs = 'source = "mine"\n[[pairs]]\nnominal = "nominal"\nchanged = "changed"\nhidden = ["speed_gain"]\n'
    (folder / "pairs.toml").write_text(pairs, encoding="utf-8")
    (case,) = real_cases(folder)
    assert case.name == "mine_00"
    assert [run.split for run in case.changed.runs] == ["fit", "validation"]
    assert [run.file for run in case.test] == ["run_2.csv"]
    assert case.truth["hidden"][0]["name"] == "speed_gain"
    with pytest.raises(InputError, match=r"none of the known recordings \(robotino\)"):
        next(real_cases(made))


def test_a_simulated_case_has_hidden_test_runs_of_its_own():
    pytest.importorskip("numba")
    case = simulated_case(401, "case_000")
    commands = [run.command.wheels_rpm.tobytes() for run in case.changed.runs]
    assert all(run.command.wheels_rpm.tobytes() not in commands for run in case.test)
    assert case.truth["hidden"][0]["effect"] == "speed_saturation"
    assert case.floor_rpm > 0.0


def test_parquet_tables_hold_all_runs(bench: Path):
    parquet = pytest.importorskip("pyarrow.parquet")
    from sysid.studies.gapbench.bench import write_parquet

    write_parquet(bench / "cases/case_000", bench / "parquet/case_000")
    table = parquet.read_table(bench / "parquet/case_000/changed.parquet")
    runs = read_dataset(bench / "cases/case_000/changed").runs
    assert table.num_rows == sum(run.time_s.size for run in runs)
    assert {"file", "group", "split", "time_s", "speed_rpm", "simulated_rpm"} <= set(table.column_names)
