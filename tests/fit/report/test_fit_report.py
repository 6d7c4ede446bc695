"""The page of a fit: self-contained, drawn by a browser without network and without an error."""

import contextlib
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from sysid.fit import Fit, FitOptions, fit_dataset, fitted_model
from sysid.fit.report import write_fit_plots, write_fit_report
from sysid.fit.report.plots import run_views
from sysid.logs import read_dataset


@pytest.fixture(scope="module")
def fit() -> Fit:
    logs = read_dataset(Path(__file__).parents[3] / "examples" / "logs")
    return fit_dataset(logs, FitOptions(starts=1, effects="off"))


@pytest.fixture(scope="module")
def page(fit: Fit, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_fit_report(fit, fitted_model(fit), path)
    return path


def test_the_page_loads_nothing_from_elsewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    outside = re.sub(r"<script.*?</script>", "", text, flags=re.S)
    assert not re.search(r"(?:src|href)\s*=\s*[\"']?(?:https?:)?//", outside)
    assert not re.search(r"<script[^>]*\bsrc\b", text)


def test_the_page_says_what_was_found(page: Path, fit: Fit) -> None:
    text = page.read_text(encoding="utf-8")
    assert fit.dataset.name in text
    assert "The identified wheel inside MuJoCo" in text
    assert "A stable third-order law predicts the test runs" in text
    assert "The robot around the wheels" not in text  # a bench log


def test_a_browser_without_network_draws_every_plot(
    page: Path, draw_page: Callable[[Path], tuple[int, int, list[str]]]
) -> None:
    figures, drawn, console = draw_page(page)
    assert figures >= 8
    assert drawn == figures
    assert console == []


@pytest.mark.parametrize("width", [390, 1280])
def test_no_text_lies_over_text(
    page: Path, crossed_text: Callable[[Path, int], list[str]], width: int
) -> None:
    assert crossed_text(page, width) == []


def test_held_out_runs_are_shown_worst_first(fit: Fit) -> None:
    views = run_views(fit, most=6)
    assert [view.split for view in views[:2]] == ["test", "test"]
    assert views[0].rms_rpm >= views[1].rms_rpm
    assert {view.split for view in views} == {"fit", "validation", "test"}


def test_no_title_of_the_picture_is_cut_or_crossed(fit: Fit, tmp_path: Path, monkeypatch) -> None:
    drawn: list[Figure] = []
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, *_, **__: drawn.append(figure))
    monkeypatch.setattr("sysid.fit.report.plots.atomic_path", lambda path: contextlib.nullcontext(path))
    views = [replace(view, name="a_long_name_of_a_run_" * 3 + ".csv") for view in run_views(fit, most=4)]
    monkeypatch.setattr("sysid.fit.report.plots.run_views", lambda *_, **__: views)
    write_fit_plots(fit, tmp_path)
    figure = drawn[0]
    FigureCanvasAgg(figure).draw()
    titles = [ax.title.get_window_extent() for ax in figure.axes]
    assert all(title.x0 >= 0.0 and title.x1 <= figure.bbox.width for title in titles)
    assert [a for i, a in enumerate(titles) for b in titles[:i] if a.overlaps(b)] == []


def test_the_picture_is_written(fit: Fit, tmp_path: Path) -> None:
    path = write_fit_plots(replace(fit), tmp_path)
    assert path.read_bytes().startswith(b"\x89PNG")
