"""gap.json, the sentence and the ten lines: the contract, and the same words everywhere."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.effects import CATALOGUE
from mecanum_env.model import paper_model
from sysid.gap import GapOptions, analyse
from sysid.gap.report.held_out import Comparison, differences, overlays
from sysid.gap.report.output import gap_json, gap_table
from sysid.gap.report.samples import HeldCommand, Samples
from sysid.gap.result import Difference, FoundEffect, GapReport, Interval, Untestable
from sysid.gap.wording import (
    closure,
    concentrations,
    interval_text,
    next_step,
    number,
    sizes,
    verdict_sentence,
    with_share,
)
from sysid.logs import Dataset, Split

VERDICTS = ("named", "no_gap", "unexplained", "ambiguous")
CONTRACT = {
    "format", "verdict", "effects", "candidates", "gap", "channels", "where", "untestable", "next_experiment",
    "evidence", "provenance", "held_out",
}  # fmt: skip


@pytest.mark.parametrize("verdict", VERDICTS)
def test_the_contract_s_keys_are_there_and_all_numbers_are_finite(
    every_report: dict[str, GapReport], verdict: str
):
    value = json.loads(json.dumps(gap_json(every_report[verdict]), allow_nan=False))
    assert set(value) >= CONTRACT
    assert value["format"] == "mecanum-gap/1"
    assert value["verdict"] == verdict
    assert set(value["gap"]) >= {"unit", "before", "after", "noise_floor"}
    assert all(
        set(channel) >= {"unit", "before", "after", "noise_floor"} for channel in value["channels"].values()
    )
    assert all(set(region) >= {"channel", "region", "rms", "share"} for region in value["where"])
    assert all(set(u) >= {"name", "reason", "smallest_detectable"} for u in value["untestable"])
    assert all(set(e) >= {"effects", "validation_rms", "test_rms", "bic"} for e in value["evidence"])
    assert set(value["provenance"]) >= {"seed", "data_sha256", "model_sha256", "version"}


def test_an_effect_is_written_as_the_contract_says(named: GapReport):
    assert gap_json(named)["effects"] == [
        {
            "name": "backlash",
            "form": "coast",
            "forms_tied": [],
            "parameters": {"gap_deg": {"value": 2.1, "low": 1.9, "high": 2.3}},
            "selection_frequency": 0.97,
            "since": "unknown",
        }
    ]


def test_the_next_experiment_is_columns_of_a_log(ambiguous: GapReport, named: GapReport):
    planned = gap_json(ambiguous)["next_experiment"]
    assert set(planned) >= {"why", "power", "time_s", "command_v_rpm", "command_theta_deg", "command_vc_rpm"}
    assert len(planned["time_s"]) == len(planned["command_v_rpm"])
    assert gap_json(named)["next_experiment"] is None


def test_what_is_not_a_number_is_null(named: GapReport):
    odd = replace(
        named,
        p_value=float("nan"),
        gap=Difference("rpm", 1.0, float("inf"), None),
        effects=(
            FoundEffect("body_speed_limit", {"v_rpm": Interval(np.float64(3.0), 1.0, float("inf"))}, 1.0),
        ),
    )
    value = json.loads(json.dumps(gap_json(odd), allow_nan=False))
    assert value["p_value"] is None
    assert value["gap"]["after"] is None
    assert value["gap"]["closed"] is None
    assert value["effects"][0]["parameters"]["v_rpm"] == {"value": 3.0, "low": 1.0, "high": None}


@pytest.mark.parametrize("verdict", VERDICTS)
def test_terminal_and_file_say_the_same_sentence_in_ten_lines(
    every_report: dict[str, GapReport], verdict: str
):
    report = every_report[verdict]
    lines = gap_table(report).splitlines()
    assert verdict_sentence(report) in lines[0]
    assert gap_json(report)["sentence"] == verdict_sentence(report)
    assert 4 <= len(lines) <= 10
    assert lines[-1].startswith("next")


def test_ten_lines_hold_the_next_step_and_what_is_gone_beside_the_logs_of_the_fit(ambiguous: GapReport):
    report = replace(
        ambiguous,
        gap_beside_fit=Difference("rpm", 4.0, 1.2, 1.0),
        untestable=(Untestable("payload", "a wheel in the air has none", {}),),
        notes=("a note",),
    )
    lines = gap_table(report).splitlines()
    assert len(lines) <= 10
    assert lines[-1].startswith("next ")
    assert "beside the logs of the fit 4 -> 1.2 rpm (noise 1); 93% of what is above noise is gone" in lines[1]
    assert gap_json(report)["gap_beside_fit"]["closed"] == pytest.approx(2.8 / 3.0)
    assert gap_json(ambiguous)["gap_beside_fit"] is None


def test_the_sentences_name_what_was_found(every_report: dict[str, GapReport]):
    said = {verdict: verdict_sentence(report) for verdict, report in every_report.items()}
    assert said["named"].startswith("The model lacks backlash: with it")
    assert "roller_friction or sensor_scale + mount_yaw" in said["ambiguous"]
    assert "cannot tell which" in said["ambiguous"]
    assert said["no_gap"].startswith("No gap")
    assert "There is a gap" in said["unexplained"]


def test_without_an_experiment_the_next_step_is_a_direct_check(ambiguous: GapReport):
    assert "run next_experiment.csv" in next_step(ambiguous)
    asked = next_step(replace(ambiguous, next_experiment=None))
    assert asked.startswith("measure ")
    assert CATALOGUE["mount_yaw"].direct_check in asked


def test_the_words_say_which_runs_the_differences_are_of(named: GapReport):
    assert "on unseen test runs falls from" in verdict_sentence(named)
    assert "on unseen test runs" in gap_table(named).splitlines()[1]
    assert gap_json(named)["held_out"] == "test"
    for split in ("validation", "fit", "test"):
        seen = replace(named, held_out=split, unseen=False)
        assert f"on {split} runs (also used to decide) falls from" in verdict_sentence(seen)
        assert "unseen" not in gap_table(seen)
        assert gap_json(seen)["held_out"] == split


@pytest.mark.parametrize(
    ("splits", "held_out", "unseen"),
    [
        (("fit", "validation", "test"), "test", True),
        (("fit", "validation", "validation"), "validation", False),
        (("fit", "fit", "fit"), "fit", False),
        (("test", "test", "test"), "test", False),  # then test runs decide
    ],
)
def test_a_study_tells_which_runs_stand_in_for_missing_test_runs(
    bench_logs: Callable[..., Dataset], splits: tuple[Split, ...], held_out: str, unseen: bool
):
    renamed = dict(zip(("fit", "validation", "test"), splits, strict=True))
    logs = bench_logs(paper_model(), repeats=1)
    runs = tuple(replace(run, split=renamed[run.split]) for run in logs.runs)
    options = GapOptions(only=("speed_gain",), max_effects=1, next_experiment=False)
    report = analyse(replace(logs, runs=runs), paper_model(), options)
    assert (report.held_out, report.unseen) == (held_out, unseen)


def test_a_sentence_says_how_large_the_difference_is_beside_the_motion(
    named: GapReport, no_gap: GapReport, unexplained: GapReport
):
    for report in (named, no_gap, unexplained):
        gap = replace(report.gap, before=6.0, after=6.0, motion=50.0)
        assert "6 rpm (12% of the rms speed)" in verdict_sentence(replace(report, gap=gap))
    several = Difference("sigma", 2.0, 1.0, 1.0, motion=400.0)
    assert with_share(2.0, several) == "2 sigma (0.5% of the rms motion)"
    assert with_share(2.0, Difference("rpm", 2.0, 1.0, 1.0)) == "2 rpm"


def test_the_motion_is_that_of_the_measurement(bench_logs: Callable[..., Dataset]):
    options = GapOptions(only=("speed_gain",), max_effects=1, next_experiment=False)
    logs = bench_logs(paper_model(), repeats=1)
    report = analyse(logs, paper_model(), options)
    measured = [run.channels["speed_rpm"] for run in logs.split("test")]
    assert report.gap.motion == pytest.approx(np.sqrt(np.mean(np.concatenate(measured) ** 2)))
    assert gap_json(report)["channels"]["speed_rpm"]["motion"] == report.gap.motion


def test_a_pose_moves_from_where_its_run_starts():
    time = np.arange(5.0)
    still = HeldCommand(np.zeros(1), np.zeros((1, 4)))
    pose = Samples("x_m", time, 100.0 + time, 99.0 + time, 100.0 + time, still)
    comparison = Comparison("test", (pose,))
    gap, _ = differences(Dataset("pose", (), ()), comparison, {})
    assert gap.motion == pytest.approx(np.sqrt(6.0))
    assert (gap.before, gap.after) == (1.0, 0.0)


def test_a_channel_without_samples_has_no_difference():
    time, held = np.arange(4.0), HeldCommand(np.zeros(1), np.zeros((1, 4)))
    speed = Samples("speed_fl_rpm", time, time, time - 2.0, time, held)
    empty = Samples("vx_m_s", time, np.full(4, np.nan), time, time, held)
    comparison = Comparison("test", (speed, empty))
    gap, channels = differences(Dataset("robot", (), ()), comparison, {})
    assert list(channels) == ["speed_fl_rpm"]
    assert gap.before == 2.0
    assert [overlay.channel for overlay in overlays(comparison)] == ["speed_fl_rpm"]


def test_an_error_that_rises_is_not_said_to_fall(named: GapReport):
    worse = replace(named, gap=Difference("rpm", 2.0, 3.0, 1.0))
    assert "rises from 2 to 3 rpm" in verdict_sentence(worse)
    assert "none of what is above noise is gone" in gap_table(worse)
    assert "let more logs confirm the new model.json" in gap_table(worse)


def test_what_may_be_noise_or_not_is_not_called_noise(no_gap: GapReport):
    sentence = verdict_sentence(replace(no_gap, trusted=False))
    assert "how much of that the model errs by itself is not known" in sentence
    assert "No gap" not in sentence


def test_a_law_that_fits_better_than_any_effect_is_told(unexplained: GapReport):
    assert "the wheel law fitted again explains better" in verdict_sentence(unexplained)
    assert "python -m sysid.fit" in gap_table(unexplained)
    other = replace(unexplained, evidence=unexplained.evidence[::-1])
    assert "no effect of the catalogue explains" in verdict_sentence(other)


def test_closure_is_the_part_above_the_noise():
    assert closure(Difference("rpm", 6.0, 2.0, 1.0)) == pytest.approx(0.8)
    assert closure(Difference("rpm", 6.0, 3.0, None)) == pytest.approx(0.5)
    assert closure(Difference("rpm", 0.9, 0.9, 1.0)) is None


def test_a_region_stands_out_by_more_error_than_samples(named: GapReport, no_gap: GapReport):
    assert concentrations(named)[0].region.region == "reversal"
    assert concentrations(named)[0].sample_share < 0.2
    assert concentrations(no_gap) == ()


def test_sizes_have_the_units_of_the_catalogue():
    assert sizes("backlash", {"gap_deg": 2.0}) == "gap_deg 2 deg"
    assert sizes("speed_gain", {"gain": 0.95}) == "gain 0.95"
    assert [number(x) for x in (None, 0.70001, 812.4, -2312.4, 1.5e7)] == [
        "-",
        "0.7",
        "812",
        "-2312",
        "1.5e+07",
    ]


def test_an_interval_is_written_to_as_many_digits_as_it_is_wide():
    assert interval_text(Interval(2.9961, 2.9912, 3.0011), "deg") == ("2.9961 deg", "2.9912 .. 3.0011")
    assert interval_text(Interval(0.934, 0.901, 0.952), "") == ("0.934", "0.901 .. 0.952")
    assert interval_text(Interval(812.0, 640.0, 950.0), "rpm/s") == ("812 rpm/s", "640 .. 950")
    assert interval_text(Interval(3.0, 1.0, float("inf")), "rpm") == ("3 rpm", "1 .. inf")


def test_a_torque_is_a_droop_and_a_number_of_n_m_only_where_the_stiffness_is_known():
    torque, droop = Interval(0.4, 0.3, 0.5), Interval(12.0, 9.0, 15.0)
    found = FoundEffect("coulomb_friction", {"torque_n_m": torque}, 1.0, droop)
    assert found.estimates == {"droop_rpm": droop, "torque_n_m": torque}
    assert replace(found, torque_known=False).estimates == {"droop_rpm": droop}
    assert FoundEffect("speed_gain", {"gain": torque}, 1.0, torque_known=False).estimates == {"gain": torque}
    cold = {"torque_n_m": torque, "damping_n_m_s_rad": torque, "time_constant_s": torque}
    bearing = FoundEffect("warm_up/cold_friction", cold, 1.0, droop, torque_known=False)
    assert bearing.estimates == {"droop_rpm": droop, "time_constant_s": torque}


def test_the_droop_of_a_torque_is_in_the_file_and_in_the_text(named: GapReport):
    torque, droop = Interval(0.4, 0.3, 0.5), Interval(12.0, 9.0, 15.0)
    found = FoundEffect("stiction", {"breakaway_n_m": torque}, 1.0, droop, torque_known=False)
    report = replace(named, effects=(found,))
    (written,) = gap_json(report)["effects"]
    assert written["droop_rpm"] == {"value": 12.0, "low": 9.0, "high": 15.0}
    assert set(written["parameters"]) == {"breakaway_n_m"}
    assert "droop_rpm 12.0 rpm (9.0 .. 15.0)" in gap_table(report)
    assert "n_m" not in gap_table(report)


def test_a_gap_without_a_name_tells_which_set_comes_closest(unexplained: GapReport):
    near = replace(unexplained.evidence[0], effects=("warm_up",), score=-20.0, test_rms=2.5)
    base = replace(near, effects=(), score=0.0, test_rms=4.0)
    told = gap_table(replace(unexplained, evidence=(near, base)))
    assert "closest: warm_up, 4 -> 2.5 rpm on test runs, which is not enough" in told
    assert "explain the data" not in told
    # A set that is no better than none comes close to nothing.
    assert "closest" not in gap_table(replace(unexplained, evidence=(base, replace(near, score=1.0))))
