"""Self-contained HTML pages: a template and interactive figures, without network access.

The plotting script is part of the page, which has about 5 MB.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mecanum_env.files import write_text


def figure(
    traces: Sequence[Mapping[str, Any]],
    *,
    title: str = "",
    x: str = "",
    y: str = "",
    height: int = 320,
    layout: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Return a Plotly figure of traces (curves, markers ...) as a JSON object.

    `x` and `y` are the titles of the axes, the height is in pixels, and entries of `layout` override these.
    """
    base: dict[str, Any] = {
        "title": {"text": title, "font": {"size": 14}, "x": 0.01, "xanchor": "left"},
        "xaxis": {"title": {"text": x}, "zeroline": False},
        "yaxis": {"title": {"text": y}, "zeroline": False},
        "height": height,
        "margin": {"l": 60, "r": 20, "t": 60 if title else 30, "b": 45},
        "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 1.0, "xanchor": "right"},
        **(layout or {}),
    }
    return {"data": [dict(trace) for trace in traces], "layout": base}


def write_page(path: Path, template: Path, figures: Mapping[str, Mapping[str, Any]], **values: Any) -> None:
    """Write a page from a template, whole or not at all.

    Args:
        path: file of the page.
        template: file of the template; it may extend "base.html" or templates in its own folder.
        figures: element id -> figure; the template places one by ``{{ plot("id") }}``.
        **values: further values of the template.
    """
    import jinja2
    import plotly.io
    from markupsafe import Markup
    from plotly.offline import get_plotlyjs

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([template.parent, Path(__file__).parent]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )

    def plot(name: str) -> Markup:
        text = plotly.io.to_html(
            dict(figures[name]), full_html=False, include_plotlyjs=False, div_id=name, validate=False,
            config={"displaylogo": False, "responsive": True},
        )  # fmt: skip
        return Markup(text)

    script = Markup(get_plotlyjs())
    write_text(path, environment.get_template(template.name).render(plot=plot, plotly=script, **values))
