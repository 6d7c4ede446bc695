"""The page of a gap study: self-contained, says what was found, drawn by a browser without network."""

import html
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from sysid.gap.report.output import gap_table
from sysid.gap.report.page import write_gap_report
from sysid.gap.report.plots import heat_figure, heat_scale
from sysid.gap.result import Difference, GapReport
from sysid.gap.wording import verdict_sentence

VERDICTS = ("named", "no_gap", "unexplained", "ambiguous")
Drawn = Callable[[Path], tuple[int, int, list[str]]]


@pytest.fixture(scope="module")
def pages(every_report: dict[str, GapReport], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    for verdict, report in every_report.items():
        write_gap_report(report, folder / f"{verdict}.html")
    return {verdict: folder / f"{verdict}.html" for verdict in every_report}


def words(page: Path) -> str:
    """Return the text of a page: no scripts, no tags, entities read."""
    bare = re.sub(r"<(script|style).*?</\1>", " ", page.read_text(encoding="utf-8"), flags=re.S)
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", bare)).split())


@pytest.mark.parametrize("verdict", VERDICTS)
def test_the_page_says_the_verdict_and_loads_nothing(
    pages: dict[str, Path], every_report: dict[str, GapReport], verdict: str
):
    assert verdict_sentence(every_report[verdict]) in words(pages[verdict])
    text = pages[verdict].read_text(encoding="utf-8")
    assert not re.search(r"<(?:script|link|img)[^>]*\b(?:src|href)\b", text)


def test_each_verdict_has_its_sections(pages: dict[str, Path]):
    titles = {
        v: set(re.findall(r"<h2>(.*?)</h2>", page.read_text(encoding="utf-8"))) for v, page in pages.items()
    }
    assert "What was missing" in titles["named"]
    assert {"What explains the data equally well", "The next experiment"} <= titles["ambiguous"]
    assert "A custom effect is proposed" in titles["unexplained"]
    assert not titles["no_gap"] & {"What was missing", "The next experiment", "A custom effect is proposed"}
    shared = {"The gap, channel by channel", "The worst runs", "Where the error is", "The evidence"}
    assert all(shared | {"What these logs could not show"} <= t for t in titles.values())


def test_the_evidence_marks_what_was_adopted_and_what_is_tied(pages: dict[str, Path]):
    text = words(pages["ambiguous"])
    assert "roller_friction (adopted)" in text
    assert "sensor_scale + mount_yaw (tied)" in text
    assert "names the truth among roller_friction, sensor_scale + mount_yaw with a probability of 93%" in text


def test_the_heat_map_has_one_scale_for_both_halves(named: GapReport, no_gap: GapReport):
    heat = heat_figure(named)
    assert heat is not None
    before, after = heat["data"]
    assert before["coloraxis"] == after["coloraxis"]
    assert before["y"][:3] == ["phase · rest", "phase · start", "phase · steady"]
    worst = before["y"][max(range(len(before["y"])), key=lambda i: before["z"][i][0])]
    assert worst == "phase · reversal"
    assert max(row[0] for row in after["z"]) < 1.2
    assert len(heat_figure(no_gap)["data"]) == 1


@pytest.mark.parametrize("verdict", ["ambiguous", "unexplained"])
def test_a_browser_without_network_draws_every_plot(pages: dict[str, Path], draw_page: Drawn, verdict: str):
    figures, drawn, console = draw_page(pages[verdict])
    assert figures >= 3
    assert drawn == figures
    assert console == []


@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("verdict", ["named", "ambiguous"])
def test_no_text_lies_over_text(
    pages: dict[str, Path], crossed_text: Callable[[Path, int], list[str]], verdict: str, width: int
):
    assert crossed_text(pages[verdict], width) == []


def test_a_page_is_small(pages: dict[str, Path]):
    assert max(page.stat().st_size for page in pages.values()) < 1_500_000


def test_the_page_says_which_runs_its_numbers_are_of(named: GapReport, tmp_path: Path):
    seen = replace(named, held_out="validation", unseen=False)
    write_gap_report(seen, tmp_path / "seen.html")
    text = words(tmp_path / "seen.html")
    assert "before, on validation runs (also used to decide)" in text
    assert "simulated on validation runs (also used to decide)" in text
    assert "unseen" not in text


def test_a_study_with_little_to_show_has_a_page_too(named: GapReport, tmp_path: Path):
    unknown = Difference("rpm", 3.0, 1.0, None)
    bare = replace(
        named, gap=unknown, channels={"speed_rpm": unknown}, where=(), overlays=(), evidence=(),
        untestable=(), smallest_detectable={}, findings=(), notes=(), provenance={},
    )  # fmt: skip
    write_gap_report(bare, tmp_path / "bare.html")
    text = words(tmp_path / "bare.html")
    assert "the logs have no repeats" in text
    assert "Nothing odd was noticed." in text
    assert len(gap_table(bare).splitlines()) >= 3


def test_without_noise_the_heat_map_is_relative_to_the_channel_s_error(named: GapReport):
    unknown = replace(named.channels["speed_rpm"], noise_floor=None)
    scale, unit = heat_scale(replace(named, channels={"speed_rpm": unknown}))
    assert unit == "of the mean error"
    assert scale == {"speed_rpm": unknown.before}
