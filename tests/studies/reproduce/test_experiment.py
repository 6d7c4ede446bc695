"""The whole experiment in small: its figures, determinism, progress, and what the command writes of it.

All in one file, since one worker runs a file and all share one experiment.
"""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from mecanum_env.cli import run
from mecanum_env.files import write_json
from mecanum_env.law import WheelLaw
from mecanum_env.parallel import Workers
from sysid.studies.reproduce import published
from sysid.studies.reproduce.__main__ import main
from sysid.studies.reproduce.charts import charts, write_reproduction_plots
from sysid.studies.reproduce.contenders import (
    COMPARED,
    CONTENDERS,
    OURS,
    QUICK,
    USABLE_RMS_RPM,
    WITH_STARTS,
    identify,
    identify_from,
    shared_starts,
)
from sysid.studies.reproduce.data import record_data_sets
from sysid.studies.reproduce.experiment import STAGES, reproduce
from sysid.studies.reproduce.pages import (
    FORMAT,
    chapters,
    reproduction_json,
    reproduction_markdown,
    write_reproduction_page,
)
from sysid.studies.reproduce.prediction import model_step, pooled_rms, rms_error
from sysid.studies.reproduce.tables import number


def test_usable_is_the_papers_own_optimum():
    assert math.isclose(USABLE_RMS_RPM**2, 21.80)


def test_fewer_starts_are_the_first_of_more():
    assert shared_starts(10, 3) == shared_starts(50, 3)[:10]
    assert shared_starts(10, 3) != shared_starts(10, 4)


@pytest.mark.parametrize("name", ["output-error", "kkt", "gradient", "poles", "kkt-adaptive"])
def test_all_methods_start_from_the_same_laws(name, quick):
    initial = [start.initial for start in quick.estimates[name].starts]
    assert tuple(initial) == shared_starts(10, 0)


def test_output_error_always_succeeds_and_is_always_stable(quick):
    for rates in (quick.ten_starts[OURS], quick.many_starts[OURS]):
        assert rates.success.share == rates.stable.share == rates.success_and_stable.share == 1.0
        assert rates.unstable_starts.count > 0  # although half of its starts are not


@pytest.mark.parametrize("name", ["kkt", "poles", "kkt-improved", "kkt-adaptive", "poles-adaptive"])
def test_constrained_methods_are_always_stable(name, quick):
    assert quick.many_starts[name].stable.share == 1.0


def test_the_unconstrained_method_is_not(quick):
    assert quick.many_starts["gradient"].stable.share < 1.0


def test_adaptive_steps_get_further_than_the_constant_rate(quick):
    for name in ("gradient", "kkt", "poles"):
        fixed, adaptive = quick.many_starts[name], quick.many_starts[f"{name}-adaptive"]
        assert np.median(adaptive.rms_rpm) < 0.2 * np.median(fixed.rms_rpm)


def test_counts_are_consistent(quick):
    for rates in (*quick.ten_starts.values(), *quick.many_starts.values()):
        assert rates.success_and_stable.count <= min(rates.success.count, rates.stable.count)
        assert rates.success.count <= rates.usable.count
        assert rates.diverged.count + rates.out_of_iterations.count <= rates.starts == len(rates.rms_rpm)
        assert np.all(np.diff(rates.rms_rpm[np.isfinite(rates.rms_rpm)]) >= 0.0)


def test_one_start_alone_ends_where_it_ends_among_others(data):
    contender = CONTENDERS["kkt"]
    together = identify(data.fit_runs, contender, QUICK, 0, 3)
    alone = identify_from(data.fit_runs, contender, QUICK, 0, 2)
    np.testing.assert_allclose(
        alone.starts[0].coefficients, together.starts[2].coefficients, rtol=1e-6, atol=1e-9
    )


def test_a_search_that_diverges_alone_gives_none(data):
    fates = [identify_from(data.fit_runs, CONTENDERS["gradient"], QUICK, 0, i) for i in range(10)]
    assert any(fate is None for fate in fates)
    assert any(fate is not None for fate in fates)


def test_laws_of_unit_gain_have_no_steady_state_error(quick):
    for name in ("output-error", "kkt-improved", "exhaustive", "one-step"):
        assert abs(quick.models[name].relative_error) <= 1e-12


def test_after_one_second_what_is_left_is_the_slowest_pole(quick):
    law, model = quick.estimates[OURS].law, quick.models[OURS]
    assert model.relative_error_after_1_s < 0.0
    assert abs(model.relative_error_after_1_s) < 10.0 * abs(law.poles[0]) ** 120


def test_no_method_is_nearer_to_the_fitted_steps(quick):
    rms = pooled_rms(quick.errors, "fit")
    assert min(rms, key=rms.__getitem__) == OURS


def test_output_error_simulates_the_test_data_to_little_more_than_the_noise(quick):
    assert pooled_rms(quick.errors, "test")[OURS] < 1.5 * quick.sigma_rpm
    assert pooled_rms(quick.errors, "trial")[OURS] < 2.0 * quick.sigma_rpm


def test_errors_are_those_of_the_estimator(quick, data):
    found = quick.estimates[OURS]
    assert rms_error(found.law, data.fit_runs) == pytest.approx(found.rms_rpm, rel=1e-9)


def test_every_data_set_is_compared(quick):
    roles = [errors.role for errors in quick.errors]
    assert {role: roles.count(role) for role in set(roles)} == {"fit": 4, "test": 13, "beyond": 1, "trial": 5}
    assert all(set(errors.rms_rpm) == set(COMPARED) for errors in quick.errors)


def test_the_target_is_the_papers_robot(quick):
    target = quick.target
    assert target.speeds_rpm == published.TEST_STEPS_RPM
    assert np.mean(target.true_relative_error) == pytest.approx(published.STEADY_ERROR["target"], rel=0.1)
    assert np.mean(target.true_rise_s) == pytest.approx(published.RISE_S["target"], abs=0.005)
    assert np.mean(target.true_settling_s) == pytest.approx(published.SETTLING_S["target"], abs=0.01)


def test_the_ceiling_is_found_from_the_step_beyond(quick):
    assert quick.fitted_ceiling_rpm == pytest.approx(published.CEILING_RPM, rel=0.01)
    free, limited = (shown.models_rpm[OURS][-1] for shown in (quick.beyond, quick.beyond_limited))
    assert free == pytest.approx(published.BEYOND_RPM, rel=1e-3)
    assert limited == pytest.approx(published.CEILING_RPM, rel=1e-3)


def test_costs_count_every_method_and_diverged_search(quick):
    assert set(COMPARED) <= set(quick.costs)
    for cost in quick.costs.values():
        assert cost.mean_s > 0.0
        assert 0.0 < cost.peak_memory_mib < 200.0
        assert 0 <= cost.diverged <= cost.repeats
    assert quick.costs["exhaustive"].mean_iterations > 1000


def test_the_robot_drives_the_papers_five(quick):
    assert [moved.name for moved in quick.robot] == list(published.ROBOT_LOSS)
    for moved in quick.robot:
        assert moved.loss < moved.paper_loss  # friction and load are not simulated
        assert moved.body[-1] == pytest.approx(0.0, abs=0.01 * moved.commanded)


def test_an_unstable_law_has_figures_but_no_steady_state():
    law = WheelLaw(2.0, -0.8, -0.15, 0.05, 0.05, 0.0, 1 / 120)
    assert not law.is_stable
    step = model_step(law)
    assert math.isnan(step.relative_error)
    assert not step.stable


def test_every_stage_is_told_once(quick, quick_stages):
    assert quick.seed == 0
    assert sorted(quick_stages) == sorted(STAGES)


@pytest.fixture
def again(quick, monkeypatch):
    """Return a second run on data recorded anew, without measuring times and memory, which differ."""
    record_data_sets.cache_clear()
    monkeypatch.setattr("sysid.studies.reproduce.experiment.measure_costs", lambda *_: quick.costs)
    return reproduce(0, QUICK, workers=Workers(jobs=1))


def without_cost(found):
    record = reproduction_json(found)
    del record["costs"]
    record["comparisons"] = [c for c in record["comparisons"] if c["section"] != "cost"]
    return record


def test_equal_seeds_give_equal_figures(quick, again):
    assert without_cost(quick) == without_cost(again)


def test_the_seed_moves_the_recordings():
    one, other = (record_data_sets(seed).trials[0].record.speed_rpm for seed in (0, 1))
    assert not np.array_equal(one, other)


@pytest.fixture(scope="module")
def record(quick, tmp_path_factory):
    path = tmp_path_factory.mktemp("reproduce") / "reproduce.json"
    write_json(path, reproduction_json(quick))
    return json.loads(path.read_text(encoding="utf-8"))


def test_the_json_has_every_part(record):
    assert record["format"] == FORMAT == "mecanum-reproduce/1"
    assert set(record["starts"]["ten"]) == set(record["starts"]["many"]) == set(WITH_STARTS)
    assert set(record["laws"]) == set(CONTENDERS)
    assert set(record["steps"]["models"]) == set(COMPARED)
    assert len(record["errors"]) == 23
    assert len(record["robot"]) == 5
    assert len(record["responses"]["trials"]) == 5
    rate = record["starts"]["many"]["kkt"]["stable"]
    assert rate["low"] <= rate["share"] <= rate["high"]
    assert rate["count"] == rate["share"] * rate["of"]


def test_the_json_says_how_the_figures_are_defined(record):
    assert re.search(r"within 5 % of 0\.\d+ rpm", record["definitions"]["success"])
    assert "21.8 rpm^2" in record["definitions"]["usable"]


def test_every_printed_figure_of_the_paper_stands_beside_ours(record):
    printed = " ".join(row["paper"] for row in record["comparisons"])
    for figure in ("90 %", "30 %", "60 %", "0 %", "21.8", "4.52e-04", "2.79e-06", "1.09e-02", "-4.41e-08",
                   "0.25 s", "0.22 s", "135 rpm", "1.077", "0.186", "0.0689", "0.156", "0.31", "0.0306",
                   "0.19 s"):  # fmt: skip
        assert figure in printed


def test_markdown_holds_every_table_and_picture(quick):
    text = reproduction_markdown(quick, "pictures")
    assert all(f"](pictures/{chart.name}.png)" in text for chart in charts(quick))
    for chapter in chapters(quick):
        assert f"## {chapter.title}" in text
        for table in chapter.tables:
            assert table.markdown() in text


def test_the_committed_results_are_of_this_command(quick):
    path = Path(__file__).parents[3] / "docs" / "results" / "reproduce.md"

    def headings(text):
        return [re.sub(r"\d+ starts", "starts", line) for line in text.splitlines() if line.startswith("#")]

    committed = path.read_text(encoding="utf-8")
    assert headings(committed) == headings(reproduction_markdown(quick, "reproduce"))
    assert all((path.parent / name).exists() for name in re.findall(r"\]\((reproduce/.*\.png)\)", committed))


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.12345, "0.123"),
        (9.9, "9.900"),
        (12.34, "12.3"),
        (1234.0, "1234"),
        (2.3e6, "2e+06"),
        (float("inf"), "infinite"),
    ],
)
def test_figures_are_short(value, text):
    assert number(value) == text


def test_every_table_is_rectangular(quick):
    for chapter in chapters(quick):
        for table in chapter.tables:
            assert len(table.rows) > 1
            assert {len(row) for row in table.rows} == {len(table.rows[0])}


def test_every_picture_is_written(quick, tmp_path):
    paths = write_reproduction_plots(quick, tmp_path)
    assert [path.stem for path in paths] == [chart.name for chart in charts(quick)]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths)


def test_the_page_stands_alone_and_shows_everything(quick, tmp_path):
    path = tmp_path / "report.html"
    write_reproduction_page(quick, path)
    text = path.read_text(encoding="utf-8")
    for chart in charts(quick):
        for i in range(len(chart.panels)):
            assert f'id="{chart.name}-{i}"' in text
    for chapter in chapters(quick):
        assert chapter.title in text
    assert not re.search(r'<(script|link|img)[^>]*(src|href)="https?:', text)


@pytest.mark.parametrize("width", [390, 1280])
def test_no_text_lies_over_text(quick, tmp_path, crossed_text, width):
    write_reproduction_page(quick, tmp_path / "report.html")
    assert crossed_text(tmp_path / "report.html", width) == []
    assert (tmp_path / "report.html").stat().st_size < 1_500_000


def test_the_command_line_writes_everything(quick, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("sysid.studies.reproduce.experiment.reproduce", lambda *_: quick)
    assert run(main, ["--quick", "--out", str(tmp_path / "out"), "--markdown", str(tmp_path / "r.md")]) == 0
    assert json.loads((tmp_path / "out" / "reproduce.json").read_text())["seed"] == 0
    assert (tmp_path / "out" / "starts.png").exists()
    assert (tmp_path / "r" / "starts.png").exists()
    assert "](r/starts.png)" in (tmp_path / "r.md").read_text(encoding="utf-8")
    assert "random starts" in capsys.readouterr().out
