"""The loop that drives the experiments of ambiguous cases, with a study that is played, and its table."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.files import write_json
from mecanum_env.parallel import Workers
from sysid.gap.result import Experiment, FoundEffect, GapOptions
from sysid.gap.workflow import analyse
from sysid.logs.writer import write_columns
from sysid.studies.zoo.cases.bench.draw import draw_bench_case
from sysid.studies.zoo.cases.case import Case, Hidden
from sysid.studies.zoo.cases.write import write_bench_case
from sysid.studies.zoo.nominal import nominal_model
from sysid.studies.zoo.outcome import Outcome
from sysid.studies.zoo.recorders import bench_recorder, commands_on_link, recorder
from sysid.studies.zoo.settle import settle, settle_cases, settled_file
from sysid.studies.zoo.settled import Round, Settled, settled_from_json, settled_json
from sysid.studies.zoo.settled_table import settle_table
from sysid.studies.zoo.sources import fingerprint
from sysid.studies.zoo.work import Task

PLAY = Hidden("backlash", "rest", {"gap_deg": 2.0})
CASE = Case(3, "bench", "single", "pi", "steps", "plain", hidden=(PLAY,))
TIED = (("backlash",), ("stiction",))
QUICK = GapOptions(only=("backlash", "acceleration_limit"), max_effects=1, next_experiment=False)
DRIVEN = Round(TIED, 12.0, 0.95, True, 0.8, 1.0)


def experiment(duration_s: float = 4.0) -> Experiment:
    time = np.arange(0.0, duration_s, 0.1)
    return Experiment("why", TIED, time, {"command_rpm": np.round(50.0 * np.sin(time))}, duration_s, 0.9)


def report(verdict, names=(), candidates=(), asked=None):
    return SimpleNamespace(
        verdict=verdict,
        effects=[FoundEffect(name, {}, 1.0) for name in names],
        new_effects=[FoundEffect(name, {}, 1.0) for name in names],
        candidates=candidates,
        next_experiment=asked,
        notes=("no command tells them apart",),
        gap=SimpleNamespace(before=2.0, after=1.0, noise_floor=1.0),
        gap_beside_fit=None,
        p_value=0.0,
        evidence=(),
        trusted=True,
        untestable=(),
        smallest_detectable={},
    )


def tied(asked=None, candidates=TIED):
    return report("ambiguous", candidates[0], candidates, asked)


def record(asked, rng):
    command = asked.columns["command_rpm"]
    speed = command + rng.normal(size=len(command))
    return {"time_s": asked.time_s, "command_rpm": command, "speed_rpm": speed}


def state_splits(folder, *splits):
    entries = [f'[[runs]]\nfile = "{i}.csv"\nsplit = "{split}"\n' for i, split in enumerate(splits, start=1)]
    (folder / "dataset.toml").write_text("".join(entries), encoding="utf-8")


@pytest.fixture
def logs(tmp_path):
    """Return a folder of logs with one command sequence in each split."""
    for level in (1, 2, 3):
        time = np.arange(0.0, 3.0, 0.1)
        command = np.where(time > 1.0, 20.0 * level, 0.0)
        columns = {"time_s": time, "command_rpm": command, "speed_rpm": command}
        write_columns(columns, tmp_path / f"{level}.csv")
    state_splits(tmp_path, "fit", "validation", "test")
    return tmp_path


def played(*reports):
    """Return a study that gives reports in turn, and the list of datasets that it saw."""
    waiting, seen = list(reports), []

    def study(dataset):
        seen.append(dataset)
        return waiting.pop(0)

    return study, seen


def done(verdict, names=(), *, case=CASE, first=TIED, rounds=(DRIVEN,), offered=False):
    """Return a settled case that ended with the verdict and the sets that it claims."""
    named = names[0] if verdict == "named" else ()
    return Settled(first, rounds, Outcome(case, verdict, named=named, candidates=names), offered)


def test_an_experiment_is_driven_three_times_and_its_recordings_are_studied_as_repeats(logs):
    study, seen = played(tied(experiment()), report("named", ["backlash"]))
    settled = settle(CASE, logs, study, record)
    assert (settled.verdict, settled.names, settled.right) == ("named", (("backlash",),), True)
    assert settled.result == "settled"
    (driven,) = settled.rounds
    assert (driven.candidates, driven.driving_s, driven.power, driven.decides) == (TIED, 12.0, 0.9, True)
    assert (driven.reach, driven.kept) == (pytest.approx(50.0 / 60.0), 1.0)
    new = [run for run in seen[1].runs if run.file.startswith("next")]
    assert [run.file for run in new] == ["next_1_1.csv", "next_1_2.csv", "next_1_3.csv"]
    assert {run.group for run in new} == {"next_1_1"}
    assert not np.array_equal(new[0].channel("speed_rpm"), new[1].channel("speed_rpm"))


def test_driving_ends_before_the_budget_is_exceeded(logs):
    study, _ = played(*[tied(experiment(6.0))] * 4)
    settled = settle(CASE, logs, study, record)
    assert (settled.driving_s, len(settled.rounds), settled.result) == (54.0, 3, "over budget")
    assert "54 s were driven" in settled.why_not


@pytest.mark.parametrize("splits", [(), ("fit", "validation"), ("fit", "validation", "test")])
def test_recordings_decide_and_leave_the_splits_of_the_logs_as_they_were(logs, splits):
    for file in sorted(logs.glob("*.csv"))[len(splits) or 3 :]:
        file.unlink()
    state_splits(logs, *splits)
    study, seen = played(tied(experiment()), tied(experiment(5.0)), report("no_gap"))
    settled = settle(CASE, logs, study, record)
    before, *after = ({run.file: run.split for run in dataset.runs} for dataset in seen)
    for later in after:
        assert {file: later[file] for file in before} == before
        assert {later[file] for file in later if file not in before} == {"fit"}
    assert [one.decides for one in settled.rounds] == [True, True]


def test_an_error_of_the_study_ends_the_case(logs):
    def study(_):
        raise InputError("dead sensor")

    settled = settle(CASE, logs, study, record)
    assert (settled.result, settled.why_not) == ("error", "InputError: dead sensor")


@pytest.mark.parametrize(
    ("candidates", "result"), [(TIED, "not offered"), ((("backlash",), ("play",)), "nothing to settle")]
)
def test_no_experiment_is_right_only_where_twins_are_tied(logs, candidates, result):
    study, _ = played(tied(None, candidates))
    settled = settle(replace(CASE, twins=("play",)), logs, study, record)
    assert (settled.why_not, settled.result) == ("no command tells them apart", result)


def test_a_tie_that_comes_down_to_twins_is_settled():
    case, first = replace(CASE, twins=("play",)), (("backlash",), ("play",), ("stiction",))
    assert done("ambiguous", first[:2], case=case, first=first).result == "settled"
    assert done("ambiguous", first, case=case, first=first).result == "still tied"
    assert done("named", first[1:2], case=case, first=first).result == "wrong"


def test_twins_stand_for_one_effect_of_a_pair():
    pair = replace(CASE, hidden=(PLAY, Hidden("speed_gain", "")), twins=("sensor_scale",))
    tie = (("speed_gain", "backlash"), ("backlash", "sensor_scale"))
    assert done("ambiguous", tie, case=pair, first=tie).result == "nothing to settle"


@pytest.mark.parametrize(
    ("kind", "verdict", "result"),
    [
        ("far_outsider", "unexplained", "settled"),
        ("far_outsider", "named", "wrong"),
        ("quiet", "no_gap", "settled"),
        ("quiet", "unexplained", "lost"),
        ("single", "no_gap", "lost"),
        ("single", "unexplained", "lost"),
        ("untestable", "no_gap", "settled"),
    ],
)
def test_what_is_right_depends_on_what_was_hidden(kind, verdict, result):
    hidden = CASE.hidden if kind in ("single", "untestable") else ()
    names = TIED[1:] if verdict == "named" else ()
    assert done(verdict, names, case=replace(CASE, kind=kind, hidden=hidden)).result == result


def test_a_link_of_another_period_sends_the_last_command_given():
    given = {"command_rpm": np.arange(4.0)}
    asked = replace(experiment(), time_s=0.1 * np.arange(4), columns=given, duration_s=0.4)
    slow, fast = (commands_on_link(asked, ["command_rpm"], period_s)[:, 0] for period_s in (0.15, 0.05))
    assert slow.tolist() == [0.0, 1.0, 3.0]
    assert fast.tolist() == [0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0]


def test_a_recording_holds_the_commands_that_the_drive_was_sent():
    case, _, drive = draw_bench_case(1)
    columns = bench_recorder(case)(experiment(), np.random.default_rng(0))
    row = np.searchsorted(columns["time_s"], 1.0 + drive.link.period_s)
    assert columns["time_s"][-1] == pytest.approx(4.0, abs=0.1)
    assert columns["command_rpm"][row] == pytest.approx(50.0 * np.sin(1.0), abs=5.0)
    assert np.max(np.abs(columns["speed_rpm"])) > 10.0


@pytest.mark.slow
def test_a_real_experiment_is_driven_and_studied(tmp_path):
    case = write_bench_case(1, tmp_path)
    model = nominal_model(tmp_path)
    answers = iter([lambda _: tied(experiment(2.0)), lambda dataset: analyse(dataset, model, QUICK)])
    settled = settle(case, tmp_path / "logs", lambda dataset: next(answers)(dataset), recorder(case))
    assert settled.verdict in ("no_gap", "named", "ambiguous", "unexplained")
    assert settled.driving_s == 6.0
    assert len(list((tmp_path / "logs").glob("next_1_*.csv"))) == 3


def test_a_settled_case_survives_its_file(tmp_path):
    settled = done("ambiguous", TIED, offered=True)
    write_json(tmp_path / "one.json", settled_json(settled))
    read = settled_from_json(json.loads((tmp_path / "one.json").read_text()))
    assert settled_json(read) == settled_json(settled)
    assert (read.case, read.rounds, read.result) == (CASE, settled.rounds, "over budget")


def test_only_ambiguous_cases_are_driven_and_none_twice(tmp_path):
    settled = done("named", TIED[:1])
    write_json(settled_file(Task("bench", 3), tmp_path / fingerprint()), settled_json(settled))
    outcomes = [Outcome(CASE, "ambiguous", candidates=TIED), Outcome(replace(CASE, seed=4), "named")]
    assert [one.result for one in settle_cases(outcomes, tmp_path, Workers(jobs=1))] == ["settled"]


def test_changes_of_command_that_the_link_does_not_send_are_counted(logs):
    def record_half(asked, rng):
        return {name: values[::2] for name, values in record(asked, rng).items()}

    fast = replace(experiment(), columns={"command_rpm": np.arange(40.0)})
    study, _ = played(tied(fast), report("no_gap"))
    assert settle(CASE, logs, study, record_half).rounds[0].kept == pytest.approx(0.5, abs=0.02)


def test_the_table_says_what_was_wrong_with_experiments():
    odd = replace(DRIVEN, decides=False, reach=2.8, kept=0.2)
    text = settle_table([done("no_gap", rounds=(odd, DRIVEN, DRIVEN))])
    assert "| of 3 experiments | count |" in text
    assert "times the largest speed of the logs | 1 |" in text
    assert "% of the changes) | 1 |" in text
    assert "aside for the test | 1 |" in text


def test_the_table_counts_what_could_be_settled_and_says_how_sure_it_is():
    good, bad = done("named", TIED[:1]), done("named", TIED[1:])
    twins = done("ambiguous", TIED, case=replace(CASE, twins=("stiction",)), rounds=())
    text = settle_table([good] * 9 + [bad, twins])
    assert "settles 90 % (60 to 98) of the ambiguous cases; wanted are 80 %: too few cases to tell." in text
    assert "| bench, single | 11 | 10 | 90 % (60 to 98) | 1 | 0 | 0 | 0 | 0 | 0 | 12 |" in text
    assert "| 90 % and more | 10 | 95 % | 90 % (60 to 98) |" in text
    assert "reached" in settle_table([good] * 30)
    assert "missed" in settle_table([bad] * 9)
    assert "settles - of" in settle_table([])
