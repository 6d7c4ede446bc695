"""Self-contained HTML pages: a template and interactive figures, without network access.

Every page contains the plotting script, compressed: the cartesian bundle of plotly.js (`PLOTLY`, MIT licence,
beside this file), which draws curves, bars and heat maps and adds 0.7 MB to a page. Browsers since 2023 can
unpack it (`DecompressionStream`).
"""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from mecanum_env.files import write_text

PLOTLY: Final = Path(__file__).with_name("plotly.min.js.gz")
"""`plotly-cartesian.min.js` of the npm package plotly.js-cartesian-dist-min 4.1.1, by `gzip -9n`."""
_CONFIG: Final = {
    "displaylogo": False,
    "responsive": True,
    # Nothing that was measured leaves the page: no button sends it elsewhere.
    "modeBarButtonsToRemove": ["select2d", "lasso2d", "autoScale2d", "sendChartToCloud", "sendDataToCloud"],
}
_TOOLBAR_PX: Final = 40
"""Width of the column on the right that is left to the zoom buttons."""


def figure(
    traces: Sequence[Mapping[str, Any]],
    *,
    title: str = "",
    x: str = "",
    y: str = "",
    height: int = 320,
    layout: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Return a Plotly figure of traces (curves, markers ...) as a JSON object, and its caption.

    Args:
        traces: as Plotly takes them.
        title: caption above the figure: a text of the page, so that it breaks into lines on a narrow screen.
        x: title of the horizontal axis.
        y: title of the vertical axis.
        height: of the figure [px]; a legend of several lines adds to it.
        layout: entries that replace those above. The legend stands above the plot, the zoom buttons in a
            column on its right; a margin is at least what these need.
    """
    base: dict[str, Any] = {
        "xaxis": {"title": {"text": x}, "zeroline": False, "automargin": True},
        "yaxis": {"title": {"text": y}, "zeroline": False, "automargin": True},
        "height": height,
        "modebar": {"orientation": "v"},
        "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0.0, "xanchor": "left"},
        **(layout or {}),
    }
    margin = {"l": 60, "r": _TOOLBAR_PX, "t": 20, "b": 45, **base.get("margin", {})}
    base["margin"] = {**margin, "r": max(margin["r"], _TOOLBAR_PX)}
    return {"caption": title, "data": [dict(trace) for trace in traces], "layout": base}


def write_page(path: Path, template: Path, figures: Mapping[str, Mapping[str, Any]], **values: Any) -> None:
    """Write a page from a template, whole or not at all.

    Args:
        path: file of the page.
        template: file of the template; it may extend "base.html" or templates in its own folder. Its filter
            ``code`` shows what is between backticks as code.
        figures: element id -> figure; the template places one by ``{{ plot("id") }}``.
        **values: further values of the template.
    """
    import jinja2
    from markupsafe import Markup, escape

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([template.parent, Path(__file__).parent]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )

    def plot(name: str) -> Markup:
        shown = figures[name]
        height = shown["layout"]["height"]
        return Markup(
            f"<figure><figcaption>{escape(shown['caption'])}</figcaption>"
            f'<div id="{escape(name)}" class="plotly-graph-div" style="min-height:{height}px"></div></figure>'
            f'<script type="application/json" class="plot">{_json([name, shown["data"], shown["layout"]])}'
            "</script>"
        )

    def code(text: str) -> Markup:
        return Markup(re.sub("`([^`]*)`", r"<code>\1</code>", str(escape(text))))

    environment.filters["code"] = code
    values |= {
        "plot": plot,
        "plotly": base64.b64encode(PLOTLY.read_bytes()).decode("ascii"),
        "plotly_config": Markup(_json(_CONFIG)),
    }
    write_text(path, environment.get_template(template.name).render(**values))


def _json(value: Any) -> str:
    """Return a value as JSON that may stand inside a script element: null for numbers that are not finite."""
    text = json.dumps(_plain(value), separators=(",", ":"), allow_nan=False)
    return re.sub("[<>&]", lambda found: f"\\u{ord(found[0]):04x}", text)


def _plain(value: Any) -> Any:
    """Return a value with lists for arrays, and None for numbers that are not finite."""
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, float):
        return value if abs(value) < float("inf") else None
    return value
