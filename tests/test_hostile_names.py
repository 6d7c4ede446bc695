"""Names from files reach pages as text, never as markup."""

from html.parser import HTMLParser
from pathlib import Path

import pytest

from mecanum_env.markdown import markdown_table
from mecanum_env.report import figure, write_page

HOSTILE = (
    "<script>alert(1)</script>",
    "</script><script>alert(1)</script>",
    "<img src=x onerror=alert(1)>",
    '" onmouseover="alert(1)',
    "{{ 7 * 7 }}",
    "a|b`c`",
    "\udcff",
    "\u2028",
)


class Markup(HTMLParser):
    """Collects elements, and attributes that run code."""

    def __init__(self) -> None:
        super().__init__()
        self.elements: list[str] = []
        self.handlers: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append(tag)
        self.handlers += [name for name, _ in attrs if name.startswith("on")]


def markup_of(path: Path) -> Markup:
    found = Markup()
    found.feed(path.read_text(encoding="utf-8"))
    return found


def require_harmless(hostile: Path, plain: Path) -> None:
    """Require of two pages, with hostile and with plain names, the same elements and no handler more."""
    one, other = markup_of(hostile), markup_of(plain)
    assert one.elements == other.elements
    assert one.handlers == other.handlers


@pytest.mark.parametrize("name", HOSTILE)
def test_a_page_shows_names_as_text(name, tmp_path):
    template = tmp_path / "page.html"
    body = '<p title="{{ name }}">{{ name }}</p>{{ plot("p") }}'
    template.write_text(f'{{% extends "base.html" %}}{{% block body %}}{body}{{% endblock %}}')
    for path, shown in ((tmp_path / "hostile.html", name), (tmp_path / "plain.html", "plain")):
        traces = [{"type": "scatter", "x": [0, 1], "y": [0, 1], "name": shown, "text": [shown, shown]}]
        drawn = figure(traces, title=shown, x=shown, y=shown)
        write_page(path, template, {"p": drawn}, name=shown, title=shown, provenance=shown)
    require_harmless(tmp_path / "hostile.html", tmp_path / "plain.html")


@pytest.mark.parametrize(
    "package", ["sysid/fit/report", "sysid/gap/report", "training/certify", "sysid/studies/reproduce"]
)
def test_no_template_turns_escaping_off(package):
    root = Path(__file__).parents[1]
    for path in (root / package).glob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert "|safe" not in text.replace(" ", "")
        assert "autoescape false" not in text


@pytest.mark.parametrize("name", HOSTILE)
def test_a_table_in_markdown_keeps_its_cells(name):
    table = markdown_table(("a", "b"), [(name, "c")]).splitlines()
    assert len(table) == 3
    assert "<script" not in table[2]
    assert table[2].replace("\\|", "").count("|") == table[0].count("|")


def test_what_is_between_backticks_is_code_and_nothing_else_is_markup(tmp_path: Path) -> None:
    (tmp_path / "template.html").write_text("<p>{{ text | code }}</p>{{ plot('p') }}", encoding="utf-8")
    drawn = figure([], title="t", x="x", y="y")
    text = "or than `brake_rpm_s` `<b>` <i>"
    write_page(tmp_path / "page.html", tmp_path / "template.html", {"p": drawn}, text=text)
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert page.startswith("<p>or than <code>brake_rpm_s</code> <code>&lt;b&gt;</code> &lt;i&gt;</p>")
