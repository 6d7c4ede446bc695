"""What the command writes: JSON, Markdown, page and pictures, all of the same figures."""

import json
import re
from pathlib import Path

import pytest

from mecanum_env.cli import run
from mecanum_env.files import write_json
from sysid.studies.reproduce.__main__ import main
from sysid.studies.reproduce.charts import charts, write_reproduction_plots
from sysid.studies.reproduce.contenders import COMPARED, CONTENDERS, WITH_STARTS
from sysid.studies.reproduce.pages import (
    FORMAT,
    chapters,
    reproduction_json,
    reproduction_markdown,
    write_reproduction_page,
)
from sysid.studies.reproduce.tables import number


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
