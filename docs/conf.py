"""The site: `make site` builds these pages and the reference of the public names into out/site."""

import re
from typing import Any

from mecanum_env.version import __version__

project = "mecanum-tankendo"
author = "The mecanum-tankendo developers"
copyright = "2026, " + author
release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
]
root_doc = "index"
myst_heading_anchors = 4

html_theme = "furo"
html_title = f"mecanum-tankendo {release}"
html_copy_source = False

autodoc_member_order = "alphabetical"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_preserve_defaults = True
# Docstrings write names in single backticks, as Markdown does.
default_role = "code"

POLICIES = "(../training/policies/"
"""Cards that lie beside the policies; the site has pages which include them."""


def markdown_in_docstring(
    _app: Any, _what: str, _name: str, _obj: Any, _options: Any, lines: list[str]
) -> None:
    """Translate a docstring in Markdown, as Gymnasium has them for environments; leave any other."""
    if not any(line.startswith("## ") for line in lines):
        return
    found: list[str] = []
    part = "text"
    for line in lines:
        if line.startswith("```"):
            part = "text" if part == "code" else "code"
            found += ["", f".. code-block:: {line[3:]}", ""] if part == "code" else [""]
        elif part == "code":
            found.append(f"   {line}")
        elif line.startswith("|"):
            if part == "text":
                found += ["", ".. list-table::", "   :header-rows: 1", ""]
            part = "table"
            cells = re.findall(r"(?:`[^`]*`|[^|`])+", line.strip().strip("|"))
            if set(line) - set("|-: "):
                found += [f"   {' ' if i else '*'} - {cell.strip()}" for i, cell in enumerate(cells)]
        else:
            part = "text"
            text = line.replace("|", r"\|")
            found += ["", f".. rubric:: {text.lstrip('# ')}", ""] if line.startswith("##") else [text]
    lines[:] = found


def links_beside_the_docs(_app: Any, _name: str, source: list[str]) -> None:
    """Turn links to files outside docs into links to the pages that include them."""
    source[0] = source[0].replace(POLICIES, "(reference/policy-")


def setup(app: Any) -> None:
    """Connect what translates docstrings and links."""
    app.connect("autodoc-process-docstring", markdown_in_docstring)
    app.connect("source-read", links_beside_the_docs)
